// --atlas auto: the package is that of keep or of rebuild, and what was looked at is not made twice.
#include <gtest/gtest.h>

#include <map>

#include "pipeline/compile/compile_model.h"
#include "pipeline/graph/memory_store.h"
#include "stages/atlas/atlas.h"
#include "stages/image/png_writer.h"
#include "tests/stages/atlas/atlas_fixtures.h"
#include "tests/support/command.h"
#include "tests/support/meshes.h"

namespace texmesh::compile_model_atlas_test {

/// A textured model, whose corners without texture coordinates are those of a second material.
std::string obj_of(const Mesh& mesh) {
  std::string out = "mtllib a.mtl\n";
  const auto line = [&out](const char* what, auto... numbers) {
    out += what;
    ((out += " " + std::to_string(numbers)), ...);
    out += "\n";
  };
  for (const Vec3f& p : mesh.positions) line("v", p.x, p.y, p.z);
  for (const Vec2f& uv : mesh.uv0) line("vt", uv.x, uv.y);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const bool bare = mesh.triangle_material[t] == 1;
    std::string face = bare ? "usemtl b\nf" : "usemtl a\nf";
    for (const std::uint32_t w : mesh.triangles[t])
      face += " " + std::to_string(mesh.wedge_position[w] + 1) + (bare ? "" : "/" + std::to_string(w + 1));
    out += face + "\n";
  }
  return out;
}

/// Its charts lie in a corner of the texture.
Mesh in_corner(Mesh mesh) {
  for (Vec2f& uv : mesh.uv0) uv = uv * 0.3f;
  return mesh;
}

class AutoAtlas : public ::testing::Test {
 protected:
  AutoAtlas() {
    write_noise(64);
    testing::write_text(folder_ / "a.mtl", "newmtl a\nmap_Kd a.png\nnewmtl b\nKd 1 0 0\n");
    options_.ssf.scales = 8;
    options_.skeletonization.alpha_divisor = 5;
    options_.skeletonization.offset_divisor = 50;
    options_.skeletonization.max_wrap_faces = 100;
    options_.ladder.rungs = {30, 80};
    options_.quality = {1, 1, 128, 1};
    options_.proxies.mode = ProxyMode::kNone;
    options_.set_by_user = {"proxies.mode"};
  }
  void write_noise(std::uint32_t side_px, std::uint32_t channels = 3) {
    Pixels picture{side_px, side_px, channels, {}};
    testing::Random random{1};
    for (std::uint32_t i = 0; i < channels * side_px * side_px; ++i)
      picture.data.push_back(static_cast<std::uint8_t>(random.next() % 256));
    const Bytes png = write_png(picture);
    testing::write_text(folder_ / "a.png", {png.begin(), png.end()});
  }
  CompileRequest request(AtlasMode mode) {
    CompileRequest out;
    out.input = folder_ / "a.obj";
    out.output = folder_ / "a.texmesh";
    out.options = options_;
    out.options.atlas.mode = mode;
    return out;
  }
  CompileOutcome compile(AtlasMode mode) { return compile(mode, store_); }
  CompileOutcome compile(AtlasMode mode, Store& store) {
    ran_.clear(), explained_.clear(), hits_ = 0;
    CompileRequest wanted = request(mode);
    wanted.explainer = [&](const Stage& stage, const StageExplanation&) { ++explained_[stage.name]; };
    return compile_model(wanted, store, {}, [&](const Stage& stage, StageEvent event, double, double) {
      if (event == StageEvent::kRan) ++ran_[stage.name];
      hits_ += event == StageEvent::kHit;
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
  std::map<std::string, int> ran_, explained_;
  int hits_ = 0;
};

TEST_F(AutoAtlas, KeepsAGoodAtlasByteForByte) {
  testing::write_text(folder_ / "a.obj", obj_of(testing::bumpy_sphere(12, 16)));
  const CompileOutcome chosen = compile(AtlasMode::kAuto);
  EXPECT_NE(told(chosen).find("keeps"), std::string::npos) << told(chosen);
  EXPECT_FALSE(ran_.contains("atlas"));
  EXPECT_EQ(ran_["simplification"], 1);
  const CompileOutcome kept = compile(AtlasMode::kKeep);
  EXPECT_EQ(told(kept), "");
  EXPECT_EQ(kept.package_digest, chosen.package_digest);
  EXPECT_TRUE(ran_.empty());
  EXPECT_GT(hits_, 0);
  NullStore nothing;
  EXPECT_EQ(compile(AtlasMode::kAuto, nothing).package_digest, chosen.package_digest);
  EXPECT_EQ(hits_, 0) << "nothing comes from a cache that is not there";
  for (const auto& [stage, times] : ran_)
    if (stage != "fill") EXPECT_EQ(times, 1) << stage << " without a cache";  // fill is never kept
}

/// Noise that no chart shows, in a texture of thousands of borders, costs more than its texels are worth.
TEST_F(AutoAtlas, RebuildsAFragmentedAtlasByteForByte) {
  write_noise(1024);
  testing::write_text(folder_ / "a.obj", obj_of(in_corner(testing::in_charts(testing::pole(), 600))));
  const CompileOutcome chosen = compile(AtlasMode::kAuto);
  EXPECT_NE(told(chosen).find("takes"), std::string::npos) << told(chosen);
  EXPECT_NE(told(chosen).find(kLostByRebuilding), std::string::npos) << told(chosen);
  EXPECT_EQ(std::ranges::count(chosen.notes, kRebuiltAtlasNote, &Note::code), 0) << "one line";
  EXPECT_EQ(ran_["import"], 1);
  EXPECT_EQ(ran_["simplification"], 2) << "of both atlases, and not again";
  for (const char* stage : {"import", "atlas_choice", "atlas_choice_rebuilt", "package"})
    EXPECT_EQ(explained_[stage], 1) << stage;
  const CompileOutcome rebuilt = compile(AtlasMode::kRebuild);
  EXPECT_EQ(rebuilt.package_digest, chosen.package_digest);
  EXPECT_EQ(std::ranges::count(rebuilt.notes, kRebuiltAtlasNote, &Note::code), 1);
  EXPECT_TRUE(ran_.empty());
}

TEST_F(AutoAtlas, StrangeModelsAreRebuiltOrKept) {
  std::vector<Mesh> models = testing::strange_models();
  Mesh partly = testing::bumpy_sphere(6, 8);
  for (std::size_t t = 0; t < partly.triangles.size(); ++t) partly.triangle_material[t] = t % 3 == 0;
  models.push_back(std::move(partly));
  for (std::size_t i = 0; i < models.size(); ++i) {
    SCOPED_TRACE(i);
    write_noise(i % 2 == 0 ? 1 : 33);
    testing::write_text(folder_ / "a.obj", obj_of(models[i]));
    for (const AtlasMode mode : {AtlasMode::kAuto, AtlasMode::kKeep, AtlasMode::kRebuild})
      EXPECT_GT(compile(mode).package_bytes, 0u);
  }
}

TEST_F(AutoAtlas, TransparentModelsAreRebuiltOrKept) {
  write_noise(64, 4);
  testing::write_text(folder_ / "a.mtl", "newmtl a\nmap_Kd a.png\nmap_d a.png\nnewmtl b\nKd 1 0 0\nd 0.5\n");
  testing::write_text(folder_ / "a.obj", obj_of(testing::in_charts(testing::bumpy_sphere(12, 16), 65)));
  for (const AtlasMode mode : {AtlasMode::kAuto, AtlasMode::kKeep, AtlasMode::kRebuild}) {
    SCOPED_TRACE(static_cast<int>(mode));
    EXPECT_GT(compile(mode).package_bytes, 0u);
    EXPECT_NE(testing::read_text(folder_ / "a.texmesh").find(R"("role":"alpha")"), std::string::npos);
  }
}

/// The format has a place for the file of a plane alone: those of the source have none behind other planes.
TEST_F(AutoAtlas, KeepsWhatTheSourcesFilesAreAskedOf) {
  testing::write_text(folder_ / "a.obj", obj_of(testing::in_charts(testing::bumpy_sphere(20, 30), 600)));
  options_.ladder.keep_source = true;
  const CompileOutcome chosen = compile(AtlasMode::kAuto);
  EXPECT_NE(told(chosen).find("keep-source"), std::string::npos) << told(chosen);
  EXPECT_FALSE(ran_.contains("atlas"));
  options_.atlas.mode = AtlasMode::kRebuild;
  EXPECT_THROW(check_options(options_, "options"), InputError);
}

TEST_F(AutoAtlas, ForecastsEndWhereTheChoiceIsNotKnown) {
  testing::write_text(folder_ / "a.obj", obj_of(testing::bumpy_sphere(12, 16)));
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
