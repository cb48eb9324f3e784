#include "pipeline/batch/fleet/model_list.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/schema.h"

namespace texmesh::model_list_test {
namespace fs = std::filesystem;

class ModelFiles : public ::testing::Test {
 protected:
  std::string add(const std::string& name, const std::string& text = "x") {
    fs::create_directories(fs::path(folder_ / name).parent_path());
    testing::write_text(folder_ / name, text);
    return folder_ / name;
  }
  /// What the model names, relative to the folder.
  std::vector<std::string> named_by(const std::string& model) const {
    std::vector<std::string> names = named_files(model, {});
    for (std::string& name : names) name = fs::path(name).lexically_relative(folder_.path()).string();
    return names;
  }
  using Names = std::vector<std::string>;
  testing::TemporaryFolder folder_;
};

constexpr const char* kGltf = R"({"asset":{"version":"2.0"},
  "buffers":[{"uri":"a%20b.bin","byteLength":4},{"uri":"data:;base64,AAAA","byteLength":3},{"byteLength":1}],
  "images":[{"uri":"maps/skin.png"},{"uri":"maps/none.png"},{"uri":"../outside.png"},{"bufferView":0}]})";

TEST_F(ModelFiles, OfGltf) {
  add("m/a b.bin");
  add("m/maps/skin.png");
  add("outside.png");
  const Names expected{"m/a b.bin", "m/maps/skin.png"};
  EXPECT_EQ(named_by(add("m/x.gltf", kGltf)), expected);
  const std::string json = std::string(kGltf) + std::string(3, ' ');
  std::string glb("glTF\2\0\0\0\0\0\0\0", 12);
  for (int shift = 0; shift < 32; shift += 8) glb += static_cast<char>(json.size() >> shift & 255);
  EXPECT_EQ(named_by(add("m/x.glb", glb + "JSON" + json)), expected);
}

TEST_F(ModelFiles, OfObjWithBlanksInNames) {
  add("m/my scan.mtl",
      "newmtl a\nmap_Kd -s 2 2 my skin.jpg\nmap_Ks shine.jpg\nnewmtl b\nnorm bumps\\n.png\n");
  add("m/b.mtl", "newmtl c\nmap_Kd my skin.jpg\n");
  add("m/c.mtl", "");
  add("m/my skin.jpg");
  add("m/shine.jpg");
  add("m/bumps/n.png");
  EXPECT_EQ(named_by(add("m/x.OBJ", "# scan\nmtllib my scan.mtl\r\nmtllib b.mtl c.mtl none.mtl\nv 0 0 0\n")),
            (Names{"m/b.mtl", "m/bumps/n.png", "m/c.mtl", "m/my scan.mtl", "m/my skin.jpg"}));
}

TEST_F(ModelFiles, OfPlyAndRangeScans) {
  add("skin.png");
  EXPECT_EQ(named_by(add("x.ply",
                         "ply\nformat ascii 1.0\ncomment TextureFile skin.png\nelement vertex 0\n"
                         "property float x\nend_header\n")),
            Names{"skin.png"});
  add("grid.tif");
  EXPECT_EQ(named_by(add("x.json", R"({"version":1,"type":"cylindrical-range-scan","grid":"grid.tif",
    "texture":"skin.png","y_step":1})")),
            (Names{"grid.tif", "skin.png"}));
}

TEST_F(ModelFiles, AreThoseThatCompilingReads) {
  add("m/mats/A.mtl", "\xef\xbb\xbfnewmtl a\nmap_Kd skin.jpg\nmap_Ke C:\\x\\glow.jpg\n");
  add("m/mats/skin.jpg");
  add("m/glow.jpg");
  EXPECT_EQ(named_by(add("m/x.obj", "\xef\xbb\xbfMtlLib mats\\a.mtl\n")),
            (Names{"m/glow.jpg", "m/mats/A.mtl", "m/mats/skin.jpg"}));
}

TEST_F(ModelFiles, OfBrokenAndHostileFilesAreNone) {
  for (const char* name : {"a.gltf", "a.glb", "a.obj", "a.ply", "a.json", "a.stl"})
    for (const char* text : {"", "{", "[]", R"({"buffers":7,"images":{"uri":3}})",
                             R"({"images":[3,{"uri":7}]})", "mtllib /etc/passwd", "ply\n", "glTF\2\0\0\0"})
      EXPECT_EQ(named_by(add(name, text)), Names{}) << name << " " << text;
  EXPECT_EQ(named_by(folder_ / "none.glb"), Names{});
  EXPECT_EQ(named_by(add("deep.gltf", std::string(100'000, '['))), Names{});
}

TEST_F(ModelFiles, AListTellsWhatTheRunOfEachShardCompiles) {
  add("in/m.mtl", "newmtl a\nmap_Kd skin.jpg\n");
  add("in/skin.jpg", std::string(500, 'x'));
  for (int i = 0; i < 9; ++i) add("in/m" + std::to_string(i) + ".obj", "mtllib m.mtl\n");
  for (int i = 0; i < 5; ++i) add("in/meta" + std::to_string(i) + ".json", "{}");
  PlanRequest request;
  request.inputs = {folder_ / "in"};
  request.output = folder_ / "out";
  const ModelList list = list_collection(request, 4);
  EXPECT_TRUE(testing::follows_schema(nlohmann::json::parse(write_model_list(list)), "list.v1"));
  ASSERT_EQ(list.models.size(), 9u);
  EXPECT_EQ(list.models[0].package, "m0.texmesh");
  EXPECT_EQ(list.models[0].files.size(), 2u);
  EXPECT_EQ(list.models[0].bytes, 13u + 500u + 25u);
  for (int s = 0; s < 4; ++s) {
    request.shard = {s, 4};
    const BatchPlan plan = plan_batch(request);
    EXPECT_EQ(plan.collection, list.collection);
    std::vector<std::string> of_run, of_list;
    for (const PlannedModel& m : plan.models) of_run.push_back(m.output);
    for (const ListedModel& m : list.models)
      if (m.shard == s) of_list.push_back(m.output);
    EXPECT_EQ(of_list, of_run) << s;
  }
}

}  // namespace texmesh::model_list_test
