// --atlas auto: the package is that of keep or of rebuild, and what was looked at is not made twice.
#include <gtest/gtest.h>

#include <map>

#include "pipeline/compile/compile_model.h"
#include "stages/image/png_writer.h"
#include "tests/support/command.h"
#include "tests/support/memory_store.h"
#include "tests/support/meshes.h"

namespace texmesh::compile_model_atlas_test {

/// A bumpy sphere, textured by its longitude, cut into so many charts, row by row.
std::string sphere_obj(int rows, int columns, int pieces) {
  const Mesh mesh = testing::bumpy_sphere(rows, columns);
  std::string out = "mtllib a.mtl\nusemtl a\n";
  const auto line = [&out](const char* what, auto... numbers) {
    out += what;
    ((out += " " + std::to_string(numbers)), ...);
    out += "\n";
  };
  for (const Vec3f& p : mesh.positions) line("v", p.x, p.y, p.z);
  int last = 0;
  std::map<std::pair<std::uint32_t, std::size_t>, int> known;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::size_t piece = t * static_cast<std::size_t>(pieces) / mesh.triangles.size();
    std::string face = "f";
    for (const std::uint32_t w : mesh.triangles[t]) {
      const auto [at, fresh] = known.try_emplace({w, piece}, last + 1);
      if (fresh) line("vt", mesh.uv0[w].x, mesh.uv0[w].y + 1e-5f * static_cast<float>(piece)), ++last;
      face += " " + std::to_string(mesh.wedge_position[w] + 1) + "/" + std::to_string(at->second);
    }
    out += face + "\n";
  }
  return out;
}

class AutoAtlas : public ::testing::Test {
 protected:
  AutoAtlas() {
    Pixels picture{256, 256, 3, {}};
    for (std::uint32_t i = 0; i < 256 * 256; ++i)
      for (const std::uint32_t c : {i % 256, i / 256, (i % 256) * (i / 256) / 300})
        picture.data.push_back(static_cast<std::uint8_t>(c));
    const Bytes png = write_png(picture);
    testing::write_text(folder_ / "a.png", {png.begin(), png.end()});
    testing::write_text(folder_ / "a.mtl", "newmtl a\nmap_Kd a.png\n");
    options_.ssf.scales = 8;
    options_.skeletonization.alpha_divisor = 5;
    options_.skeletonization.offset_divisor = 50;
    options_.skeletonization.max_wrap_faces = 100;
    options_.ladder.rungs = {30, 80};
    options_.quality = {1, 1, 128, 1};
    options_.proxies.mode = ProxyMode::kNone;
    options_.set_by_user = {"proxies.mode"};
  }
  CompileRequest request(AtlasMode mode) {
    CompileRequest out;
    out.input = folder_ / "a.obj";
    out.output = folder_ / "a.texmesh";
    out.options = options_;
    out.options.atlas.mode = mode;
    return out;
  }
  CompileOutcome compile(AtlasMode mode) {
    ran_.clear();
    return compile_model(request(mode), store_, {},
                         [&](const Stage& stage, StageEvent event, double, double) {
                           if (event == StageEvent::kRan) ++ran_[stage.name];
                         });
  }
  static std::string told(const CompileOutcome& outcome) {
    for (const Note& n : outcome.notes)
      if (n.code == "atlas-chosen") return n.text;
    return "";
  }
  testing::TemporaryFolder folder_;
  MemoryStore store_;
  CompileOptions options_;
  std::map<std::string, int> ran_;
};

TEST_F(AutoAtlas, KeepsAGoodAtlasByteForByte) {
  testing::write_text(folder_ / "a.obj", sphere_obj(12, 16, 1));
  const CompileOutcome chosen = compile(AtlasMode::kAuto);
  EXPECT_NE(told(chosen).find("keeps"), std::string::npos) << told(chosen);
  EXPECT_FALSE(ran_.contains("atlas"));
  EXPECT_EQ(ran_["simplification"], 1);
  const CompileOutcome kept = compile(AtlasMode::kKeep);
  EXPECT_EQ(told(kept), "");
  EXPECT_EQ(kept.package_digest, chosen.package_digest);
  EXPECT_TRUE(ran_.empty());
}

TEST_F(AutoAtlas, OfManyChartsItIsThePackageOfWhatItSays) {
  testing::write_text(folder_ / "a.obj", sphere_obj(24, 36, 600));
  const CompileOutcome chosen = compile(AtlasMode::kAuto);
  EXPECT_NE(told(chosen).find("times as far"), std::string::npos) << told(chosen);
  EXPECT_EQ(ran_["atlas"], 1);
  EXPECT_EQ(ran_["simplification"], 2) << "of both atlases, and not again";
  const bool rebuilt = told(chosen).find("takes") != std::string::npos;
  EXPECT_EQ(compile(rebuilt ? AtlasMode::kRebuild : AtlasMode::kKeep).package_digest, chosen.package_digest);
  EXPECT_TRUE(ran_.empty());
}

TEST_F(AutoAtlas, ForecastsEndWhereTheChoiceIsNotKnown) {
  testing::write_text(folder_ / "a.obj", sphere_obj(12, 16, 1));
  const auto last = [&] { return forecast_model(request(AtlasMode::kAuto), store_, {}).back(); };
  EXPECT_EQ(last().stage, "atlas_choice");
  compile(AtlasMode::kAuto);
  EXPECT_EQ(last().stage, "package");
  EXPECT_EQ(last().explanation.verdict, StageVerdict::kHit);
}

/// A worker gets its options as text.
TEST(AutoAtlasOptions, KeepTheChoiceOpenAsText) {
  CompileOptions asked, read;
  asked.atlas.mode = AtlasMode::kAuto;
  asked.ladder.rungs = {30};
  asked.proxies.mode = ProxyMode::kAuto;
  asked.set_by_user = {"proxies.mode"};
  read_profile(read, write_profile(resolve_options(asked)), "text");
  EXPECT_EQ(read.ladder.rungs, asked.ladder.rungs);
  EXPECT_FALSE(read.ladder.prune);
  read.atlas.mode = AtlasMode::kRebuild;
  EXPECT_EQ(resolve_options(read).simplification.order, CollapseOrder::kTouching);
  EXPECT_EQ(resolve_options(read).proxies.mode, ProxyMode::kAuto) << "chosen";
}

}  // namespace texmesh::compile_model_atlas_test
