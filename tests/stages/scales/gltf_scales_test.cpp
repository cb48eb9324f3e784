// GLBs beside the stream, for viewers that know glTF alone.
#include "format/container/layout.h"
#include "stages/gltf/check_glb.h"
#include "tests/stages/scales/scales_checks.h"

namespace texmesh::gltf_scales_test {

using namespace testing;  // NOLINT: fixtures and checks

/// A sphere of several scales, all of them kept; every scale but the coarsest two has a step.
class GltfScalesOf : public ::testing::Test {
 protected:
  GltfScalesOf() : c_(testing::bumpy_sphere(40, 60)) {
    c_.materials[0].base_colour_texture.image = 0;
    c_.add_image(TextureRole::kBaseColour);
    filled_.push_back(picture(528, 544, 3));  // whole fragments: more than the plane's 512 x 512
    PlaneTables t;
    t.columns = t.rows = 1;
    t.rung_quality = {30, 90};
    t.table_bytes = {0, 0};
    t.order = {0};
    t.size_bytes = {1000, 9000};
    t.dssim = {0.1f, 0.01f};
    t.covered_texels = {512 * 512};
    t.surface_fraction = {1};
    tables_.planes.push_back(t);
    c_.perceptual.object_height = 2;
    float px = 64;
    PictureLosses geometry;
    const std::size_t n = c_.scales.scales.size();
    for (std::size_t k = 0; k < n; ++k) {
      quality_.table.scales.push_back(c_.scales.scales[k].scale);
      quality_.display_px_flip.push_back(k == 0 ? 1e9f : k + 2 < n ? px * static_cast<float>(n - k) : 0);
      geometry.flip.push_back(0.01f);
    }
    geometry.flip_p95 = geometry.dssim = geometry.flip;
    const PictureLosses few{{0.02f}, {0.02f}, {0.02f}}, many{{0.6f}, {0.6f}, {0.6f}};
    quality_.table.sizes_px = {256};
    quality_.table.geometry = {geometry};
    quality_.table.groups = {{PlaneGroup::kColour, {{{0.1f}, few, many, few, few}}}};
    files_ = c_.write_streamed();
    files_.files.front().glb.resize(1 << 22);  // beside it there is room for all
  }
  GltfScales write(ScaleGlbs which, int threads = 1) const {
    ScalesOptions options;
    options.glb = which;
    RunContext context;
    context.threads = threads;
    return write_gltf_scales(c_.scales, c_.perceptual, c_.materials, c_.images, c_.fragments, filled_,
                             c_.previews, tables_, files_, quality_, options, context);
  }
  static std::vector<std::string> paths(const GltfScales& made) {
    std::vector<std::string> out;
    for (const GltfScales::File& f : made.files) out.push_back(f.path);
    return out;
  }

  Case c_;
  std::vector<Pixels> filled_;
  PackageTables tables_;
  MeasuredQuality quality_;
  ScaleFiles files_;
};

TEST_F(GltfScalesOf, TheStepsBetweenTheEndsHaveAFile) {
  ASSERT_GE(c_.scales.scales.size(), 5u);
  std::set<std::string> expected{"gltf/000-r00.jpg"}, all = expected;
  for (std::size_t k = 1; k + 1 < c_.scales.scales.size(); ++k) {
    all.insert(gltf_scale_path(c_.scales.scales[k].scale));
    if (k + 2 < c_.scales.scales.size()) expected = all;
  }
  const auto set_of = [](const std::vector<std::string>& list) {
    return std::set<std::string>(list.begin(), list.end());
  };
  EXPECT_EQ(set_of(paths(write(ScaleGlbs::kSteps))), expected);
  EXPECT_EQ(set_of(paths(write(ScaleGlbs::kAll))), all);
  EXPECT_TRUE(write(ScaleGlbs::kEnds).files.empty());
}

TEST_F(GltfScalesOf, TheFinestGoUntilAllTakeTheirShareOfTheFinestScale) {
  std::vector<std::size_t> sizes;  // of the steps' GLBs, finest first
  double whole = 0;
  for (const GltfScales::File& f : write(ScaleGlbs::kSteps).files)
    if (f.path.ends_with(".glb")) sizes.push_back(f.bytes.size()), whole += static_cast<double>(sizes.back());
  ASSERT_GE(sizes.size(), 2u);
  files_.files.front().glb.resize(static_cast<std::size_t>(whole));
  whole = static_cast<double>(files_.files.front().glb.size());
  std::set<std::size_t> seen;
  for (const double coarsest : {0.1, 0.5, 0.8, 1.0, 1.1, 1.2, 1.5}) {
    files_.files.back().glb.resize(static_cast<std::size_t>(coarsest * whole + kAnywayBytes));
    std::size_t kept = sizes.size();
    double sum = whole + static_cast<double>(files_.files.back().glb.size());
    for (const std::size_t bytes : sizes) sum += static_cast<double>(bytes);
    for (; kept > 0 && sum > kMostOverFinest * whole + kAnywayBytes; --kept)
      sum -= static_cast<double>(sizes[sizes.size() - kept]);
    const GltfScales made = write(ScaleGlbs::kSteps);
    std::vector<std::size_t> left;
    for (const GltfScales::File& f : made.files)
      if (f.path.ends_with(".glb")) left.push_back(f.bytes.size());
    EXPECT_TRUE(std::ranges::equal(left, std::span(sizes).last(kept))) << coarsest;
    EXPECT_EQ(made.notes.size(), sizes.size() - kept);
    EXPECT_EQ(made.files.size(), kept + (kept > 0 ? 1 : 0)) << "a picture that no file shows";
    EXPECT_TRUE(write(ScaleGlbs::kAll).notes.empty());
    seen.insert(kept);
  }
  EXPECT_TRUE(seen.contains(0));
  EXPECT_GE(seen.size(), 3u);
}

TEST_F(GltfScalesOf, ASmallModelKeepsItsStepsBesideThePreviewsInsideItsCoarsestGlb) {
  files_.files.front().glb.resize(5700), files_.files.back().glb.resize(6500 + 22000);
  const GltfScales made = write(ScaleGlbs::kSteps);
  std::size_t steps = 0;
  for (const GltfScales::File& f : made.files) steps += f.path.ends_with(".glb");
  EXPECT_GE(steps, 1u);
}

TEST_F(GltfScalesOf, FilesAreValidAndShowThePicture) {
  const GltfScales made = write(ScaleGlbs::kAll);
  for (const GltfScales::File& file : made.files) {
    if (file.path.ends_with(".jpg")) {
      const Pixels p = decode_jpeg(file.bytes, 512 * 512);
      EXPECT_EQ((std::array{p.width_px, p.height_px, p.channels}), (std::array{512u, 512u, 3u}));
      continue;
    }
    Findings findings;
    const GlbFacts facts = check_glb(file.bytes, file.path, findings);
    EXPECT_TRUE(findings.list().empty()) << file.path;
    const auto number = static_cast<int>(parse_entry_path(file.path).number);
    const auto& scale = *std::ranges::find(c_.scales.scales, number, &NestedScale::scale);
    EXPECT_GT(facts.triangles, scale.triangles.size() * 9 / 10);
    EXPECT_LE(facts.triangles, scale.triangles.size());
    const bool has_step = &scale + 2 <= &c_.scales.scales.back();
    EXPECT_EQ(facts.image_uris, (std::vector<std::string>{has_step ? "000-r00.jpg" : "../preview/000.jpg"}));
  }
}

TEST_F(GltfScalesOf, ThereIsNoneWithoutAStream) {
  files_.stream.clear();
  EXPECT_TRUE(write(ScaleGlbs::kAll).files.empty());
}

TEST_F(GltfScalesOf, SameBytesForAnyThreadCount) {
  const GltfScales one = write(ScaleGlbs::kAll), many = write(ScaleGlbs::kAll, 4);
  ASSERT_EQ(paths(one), paths(many));
  for (std::size_t k = 0; k < one.files.size(); ++k) EXPECT_EQ(one.files[k].bytes, many.files[k].bytes);
}

}  // namespace texmesh::gltf_scales_test
