// Which stages of the real graph run again after one option has changed: what a stage reads decides, no more.
#include <gtest/gtest.h>

#include <cstdio>
#include <set>

#include "pipeline/compile/compile_model.h"
#include "pipeline/graph/memory_store.h"
#include "pipeline/graph/store.h"
#include "tests/support/command.h"
#include "tests/support/images.h"

namespace texmesh::compile_model_reruns_test {

using Ran = std::set<std::string>;

/// A tent of two textured triangles in an OBJ file, and the cheapest options.
class Reruns : public ::testing::Test {
 protected:
  Reruns() {
    const Bytes picture =
        testing::encode_image("png", 256, 256, 3, testing::test_picture(256, 256, 3), OIIO::TypeDesc::UINT8);
    testing::write_text(folder_ / "tent.png", {picture.begin(), picture.end()});
    testing::write_text(folder_ / "tent.mtl", "newmtl cloth\nmap_Kd tent.png\n");
    testing::write_text(folder_ / "tent.obj",
                        "mtllib tent.mtl\nusemtl cloth\nv 0 0 0\nv 2 0 0\nv 2 2 1\nv 0 2 1\nvt 0 0\nvt 1 0\n"
                        "vt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n");
    options_.ssf.scales = 2;
    options_.ladder.rungs = {30, 80};
    options_.quality = {1, 32, 1};
  }
  Ran compile() {
    CompileRequest request;
    request.input = folder_ / "tent.obj";
    request.output = folder_ / "tent.texmesh";
    request.options = options_;
    Ran ran;
    compile_model(request, store_, {}, [&](const Stage& stage, StageEvent event, double, double) {
      if (event == StageEvent::kRan) ran.insert(stage.name);
    });
    return ran;
  }
  testing::TemporaryFolder folder_;
  MemoryStore store_;
  CompileOptions options_;
};

TEST_F(Reruns, OtherRungsLeavePreviewsAndTheFilesOfScalesAlone) {
  const Ran first = compile();
  for (const char* stage : {"previews", "ladder", "scales", "package"}) EXPECT_TRUE(first.contains(stage));
  EXPECT_EQ(compile(), Ran{});
  options_.ladder.rungs = {30, 60, 80};
  EXPECT_EQ(compile(),
            (Ran{"fill", "ladder", "lut", "quality", "gltf_scales", "package"}));  // fill is never stored
}

TEST_F(Reruns, WhatIsSaidOfTheObjectMakesNoMeshAndNoTextureAnew) {
  compile();
  options_.package.meta = R"({"title":"Tent","licence":"CC-BY-4.0","unit":"mm"})";
  EXPECT_EQ(compile(), Ran{"package"});
  EXPECT_EQ(compile(), Ran{});
  options_.package.meta = R"({"unit":"mm","title":"Tent","licence":"cc-by-4.0"})";  // the same in other words
  EXPECT_EQ(compile(), Ran{});
}

TEST_F(Reruns, AnotherPreviewQualityRunsWhatShowsOrMeasuresPreviews) {
  compile();
  options_.ladder.preview_quality = 80;
  const Ran ran = compile();
  for (const char* stage : {"previews", "ladder", "lut", "scales", "package"})
    EXPECT_TRUE(ran.contains(stage)) << stage;
  for (const char* stage : {"simplification", "fragmentation", "zim"})
    EXPECT_FALSE(ran.contains(stage)) << stage;
}

}  // namespace texmesh::compile_model_reruns_test
