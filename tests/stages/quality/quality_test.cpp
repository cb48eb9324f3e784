#include "stages/quality/quality.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "stages/base/run_context.h"
#include "stages/ladder/ladder.h"
#include "stages/measure/image_compare.h"
#include "stages/measure/render_view.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

/// A mesh of one textured material, coarser scales by leaving out vertices of the grid (not nested by
/// collapses; the stage asks for triangles only), a texture of waves and grain, and a ladder made by the real
/// encoder.
struct Sample {
  NestedScales scales;
  PerceptualValues perceptual;
  std::vector<Material> materials{Material{}};
  Fragments fragments;
  std::vector<Pixels> pixels;
  Ladder ladder;
};

// The sheet of n x n quads seen only at every `step`-th row and column.
NestedScale every(int n, int step, int number) {
  NestedScale s;
  s.scale = number;
  auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (n + 1) + i); };
  for (int j = 0; j < n; j += step)
    for (int i = 0; i < n; i += step) {
      s.triangles.push_back({at(i, j), at(i + step, j), at(i + step, j + step)});
      s.triangles.push_back({at(i, j), at(i + step, j + step), at(i, j + step)});
    }
  s.triangle_source.assign(s.triangles.size(), 0);
  return s;
}

Sample sample_sheet(bool textured) {
  Sample s;
  constexpr int kQuads = 32;
  s.scales.mesh = testing::sheet(kQuads, 0.2f);
  for (int k = 0; k < 4; ++k) s.scales.scales.push_back(every(kQuads, 1 << k, 3 * k));
  s.perceptual.kept = {1, 1, 0, 1};
  if (!textured) return s;

  TexturePlane plane;
  plane.width_px = plane.height_px = 256;
  plane.fragment_width_px = plane.fragment_height_px = 128;
  plane.columns = plane.rows = 2;
  plane.coverage.assign(256 * 256 / 8, 0xff);
  plane.covered_texels.assign(4, 128 * 128);
  plane.surface_fraction.assign(4, 0.25f);
  s.fragments.planes.push_back(plane);
  s.materials[0].base_colour_texture.image = 0;
  Pixels p{256, 256, 3, {}};
  testing::Random random{7};
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 256; ++x)
      for (int c = 0; c < 3; ++c)
        p.data.push_back(
            static_cast<std::uint8_t>(90 + 60 * ((x / 8 + y / 12 + c) % 2) + 40 * random.uniform()));
  s.pixels.push_back(std::move(p));
  s.ladder = encode_ladder(s.fragments, s.pixels, {}, {}, LadderOptions{}, RunContext{});
  return s;
}

QualityTable measure(const Sample& s, const QualityOptions& options = {}, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return measure_quality(s.scales, s.perceptual, s.materials, s.fragments, s.pixels, s.ladder, options,
                         context)
      .table;
}

Notes notes_of(const Sample& s) {
  return measure_quality(s.scales, s.perceptual, s.materials, s.fragments, s.pixels, s.ladder, {}, {}).notes;
}

TEST(Quality, TableHasKeptScalesAndSpreadRungs) {
  const QualityTable t = measure(sample_sheet(true));
  EXPECT_EQ(t.scales, (std::vector<int>{0, 3, 9}));
  ASSERT_EQ(t.rungs.size(), 4u);
  EXPECT_EQ(t.rungs.front(), 5);
  EXPECT_EQ(t.rungs.back(), 97);
  EXPECT_TRUE(std::is_sorted(t.rungs.begin(), t.rungs.end()));
  EXPECT_EQ(t.ssim.size(), 12u);
  EXPECT_EQ(t.difference.size(), 12u);
  EXPECT_EQ(t.views, 4u);
  EXPECT_EQ(t.size_px, 192u);
}

TEST(Quality, OriginalAtTheTopRungIsNearlyEqualAndLowerIsWorse) {
  const QualityTable t = measure(sample_sheet(true));
  EXPECT_GT(t.ssim[3], 0.97);
  EXPECT_LT(t.difference[3], 0.08);  // grain in the colours, of which 4:2:0 keeps a quarter
  for (std::size_t s = 0; s < t.scales.size(); ++s)
    for (std::size_t r = 1; r < t.rungs.size(); ++r) {
      // On another surface more texture is not exactly monotone: it no longer lies where the original's does.
      const float slack = s == 0 ? 0 : 0.02f;
      EXPECT_GE(t.ssim[s * 4 + r] + slack, t.ssim[s * 4 + r - 1]) << s << " " << r;
      EXPECT_LE(t.difference[s * 4 + r], t.difference[s * 4 + r - 1] + slack) << s << " " << r;
    }
  for (std::size_t s = 1; s < t.scales.size(); ++s) {
    EXPECT_LT(t.ssim[s * 4 + 3], t.ssim[s * 4 - 1]);
    EXPECT_GT(t.difference[s * 4 + 3], t.difference[s * 4 - 1]);
  }
  EXPECT_LT(t.ssim[0], t.ssim[3] - 0.05) << "quality 5 must show";
}

TEST(Quality, UntexturedModelHasOneColumnAndIdentity) {
  const QualityTable t = measure(sample_sheet(false));
  EXPECT_EQ(t.rungs, std::vector<int>{100});
  EXPECT_EQ(t.ssim[0], 1.f);
  EXPECT_EQ(t.difference[0], 0.f);
  EXPECT_LT(t.ssim[1], 1.f);
  EXPECT_LT(t.ssim[2], t.ssim[1]);
}

TEST(Quality, FragmentsThatNoRungStoresStayAsTheSource) {
  Sample s = sample_sheet(true);
  for (LadderRung& rung : s.ladder.planes[0].rungs) {
    rung.data.clear();
    rung.offset.assign(5, 0);
  }
  const QualityTable t = measure(s);
  for (std::size_t r = 0; r < t.rungs.size(); ++r) EXPECT_EQ(t.ssim[r], 1.f);
}

TEST(Quality, VertexColoursEmissionAndNormalsShow) {
  Sample s = sample_sheet(false);
  const QualityTable plain = measure(s);
  testing::Random random{3};
  for (std::size_t w = 0; w < s.scales.mesh.wedge_count(); ++w)
    s.scales.mesh.colours.push_back({static_cast<float>(random.uniform()), 0.5f, 0.5f, 1});
  const QualityTable coloured = measure(s);
  EXPECT_LT(coloured.ssim[2], plain.ssim[2]);
  s.materials[0].emissive = {1, 1, 1};
  EXPECT_GT(measure(s).ssim[2], coloured.ssim[2]) << "a glare hides the difference";
}

TEST(Quality, ModelsWithoutColoursHaveTheRungsOfTheirOwnMaps) {
  Sample s = sample_sheet(true);
  std::swap(s.materials[0].base_colour_texture, s.materials[0].normal_texture);
  s.fragments.planes[0].role = TextureRole::kNormal;
  const QualityTable normals = measure(s);
  EXPECT_EQ(normals.rungs, measure(sample_sheet(true)).rungs);
  EXPECT_LT(normals.ssim[0], normals.ssim[3] - 0.02) << "bad normals must show";
  EXPECT_GT(normals.difference[0], normals.difference[3] + 0.01f);

  s.materials[0].unlit = true;
  const QualityTable unseen = measure(s);
  EXPECT_EQ(unseen.rungs, normals.rungs);
  EXPECT_EQ(unseen.ssim[0], 1.f);
  EXPECT_EQ(unseen.difference[0], 0.f);
  for (std::size_t r = 1; r < 4; ++r) EXPECT_EQ(unseen.ssim[8 + r], unseen.ssim[8]);
}

TEST(Quality, ColoursAreSampledBeforeOtherMaps) {
  Sample s = sample_sheet(true);
  s.fragments.planes.insert(s.fragments.planes.begin(), s.fragments.planes[0]);
  s.pixels.push_back(s.pixels[0]);
  s.ladder.planes.push_back(s.ladder.planes[0]);
  s.fragments.planes[0].role = TextureRole::kNormal;
  s.fragments.planes[1].image = 1;
  s.ladder.planes[0].rungs.resize(2);
  s.materials[0].normal_texture.image = 0;
  s.materials[0].base_colour_texture.image = 1;
  EXPECT_EQ(measure(s).rungs, measure(sample_sheet(true)).rungs);
}

TEST(Quality, WhatIsTransparentIsNotMeasured) {
  Sample s = sample_sheet(true);
  s.materials[0].alpha_mode = AlphaMode::kBlend;
  s.materials[0].base_colour = {1, 1, 1, 0};
  const QualityTable t = measure(s);
  for (float x : t.ssim) EXPECT_EQ(x, 1.f);
  const Notes notes = notes_of(s);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0].code, "quality-not-measured");
}

TEST(Quality, SameForAnyNumberOfThreads) {
  const Sample s = sample_sheet(true);
  QualityOptions options;
  options.views = 3;
  options.size_px = 96;
  EXPECT_EQ(measure(s, options, 1), measure(s, options, 8));
}

TEST(Quality, OptionsAreTaken) {
  QualityOptions options;
  options.views = 1;
  options.size_px = 64;
  options.rung_samples = 1;
  const QualityTable t = measure(sample_sheet(true), options);
  EXPECT_EQ(t.rungs, std::vector<int>{97});
  EXPECT_EQ(t.views, 1u);
  EXPECT_EQ(t.size_px, 64u);
  options.rung_samples = 16;
  EXPECT_EQ(measure(sample_sheet(true), options).rungs, LadderOptions{}.rungs);
}

/// Adds a triangle of that side, so far away, to all scales.
void add_stray(Sample& s, float away, float side) {
  Mesh& m = s.scales.mesh;
  const auto p = static_cast<std::uint32_t>(m.positions.size()),
             w = static_cast<std::uint32_t>(m.wedge_count());
  for (Vec3f corner : {Vec3f{0, 0, 0}, Vec3f{side, 0, 0}, Vec3f{0, side, side}}) {
    m.wedge_position.push_back(static_cast<std::uint32_t>(m.positions.size()));
    m.positions.push_back(Vec3f{away, away, 0} + corner);
    if (!m.uv0.empty()) m.uv0.push_back({0.5f, 0.5f});
    if (!m.normals.empty()) m.normals.push_back({0, 0, 1});
  }
  EXPECT_EQ(m.positions.size(), p + 3);
  for (NestedScale& scale : s.scales.scales) {
    scale.triangles.push_back({w, w + 1, w + 2});
    scale.triangle_source.push_back(0);
  }
}

TEST(Quality, AStrayTriangleFarAwayChangesLittle) {
  for (bool textured : {false, true}) {
    const Sample alone = sample_sheet(textured);
    EXPECT_TRUE(notes_of(alone).empty());
    const QualityTable want = measure(alone);
    for (float away : {300.f, 1e5f}) {
      SCOPED_TRACE(away);
      if (textured && away < 1e5f) continue;  // dear
      Sample s = alone;
      add_stray(s, away, 0.02f);
      const QualityTable t = measure(s);
      ASSERT_EQ(t.ssim.size(), want.ssim.size());
      EXPECT_LT(t.ssim.back(), t.ssim[t.rungs.size() - 1]) << "the coarsest differs from S_0";
      for (std::size_t i = 0; i < t.ssim.size(); ++i) EXPECT_NEAR(t.ssim[i], want.ssim[i], 0.1) << i;
      const Notes notes = notes_of(s);
      ASSERT_EQ(notes.size(), 1u);
      EXPECT_EQ(notes[0].code, "far-outliers");
      EXPECT_NE(notes[0].text.find("the 3 of "), std::string::npos) << notes[0].text;
    }
  }
}

TEST(Quality, WhatNoPictureShowsCountsAsEqual) {
  Sample thread = sample_sheet(false);
  for (Vec3f& p : thread.scales.mesh.positions) p = {1e-7f * p.x, p.y, 1e-7f * p.z};
  Sample specks = sample_sheet(false);
  specks.scales.scales.resize(2);
  specks.perceptual.kept.resize(2);
  for (NestedScale& scale : specks.scales.scales) scale.triangles.clear(), scale.triangle_source.clear();
  specks.scales.mesh = Mesh{};
  specks.scales.mesh.triangle_material = {0}, specks.scales.mesh.triangle_part = {0};
  add_stray(specks, 1000, 0.01f);
  add_stray(specks, -1000, 0.01f);
  for (const Sample* s : {&thread, &specks}) {
    const QualityTable t = measure(*s);
    for (float x : t.ssim) EXPECT_EQ(x, 1.f);
    for (float x : t.difference) EXPECT_EQ(x, 0.f);
    const Notes notes = notes_of(*s);
    ASSERT_EQ(notes.size(), 1u);
    EXPECT_EQ(notes[0].code, "quality-not-measured");
  }
}

TEST(Quality, NothingToLookAtIsAnError) {
  Sample s = sample_sheet(false);
  for (Vec3f& p : s.scales.mesh.positions) p = {1, 2, 3};
  EXPECT_THROW(measure(s), StageError);
  s.scales.mesh.positions.clear();
  EXPECT_THROW(measure(s), StageError);
}

TEST(RenderView, ASphereCoversItsDiscWithoutHoles) {
  const Mesh mesh = testing::sphere(24, 48);
  std::vector<std::uint32_t> source(mesh.triangles.size(), 0);
  const std::vector<Material> materials(1);
  ViewScene scene;
  scene.mesh = &mesh;
  scene.triangles = &mesh.triangles;
  scene.triangle_source = &source;
  scene.materials = &materials;
  scene.base_plane = scene.emissive_plane = {-1};
  for (int v = 0; v < 4; ++v) {
    const ViewBuffer view = look_at(scene, camera_of(v, 4, {0, 0, 0}, 1), 100);
    const double disc = 3.14159265 * 96 * 96;  // samples: radius 0.96 * 100
    EXPECT_NEAR(static_cast<double>(view.samples.size()), disc, 0.02 * disc);
    for (int y = 0; y < 100; ++y)
      for (int x = 0; x < 100; ++x)
        if ((x - 49.5) * (x - 49.5) + (y - 49.5) * (y - 49.5) < 46.5 * 46.5) {
          EXPECT_EQ(view.hits[static_cast<std::size_t>(y) * 100 + static_cast<std::size_t>(x)], 4);
        }
    const Picture picture = draw(view, {});
    EXPECT_NEAR(picture.linear[50 * 100 + 50].x, 1, 0.01) << "the middle faces the head-light";
    EXPECT_NEAR(picture.linear[0].x, 0.2, 1e-6);
  }
}

TEST(RenderView, TextureStandsTheRightWayUp) {
  Mesh mesh = testing::sheet(1, 0);
  std::vector<std::uint32_t> source(2, 0);
  std::vector<Material> materials(1);
  materials[0].base_colour_texture.image = 0;
  materials[0].base_colour_texture.wrap_s = materials[0].base_colour_texture.wrap_t = Wrap::kClamp;
  materials[0].unlit = true;
  ViewScene scene{&mesh, &mesh.triangles, &source, &materials, {0}, {-1}, {{2, 2}}};
  MipTexture texture;
  texture.width_px = texture.height_px = 2;
  texture.levels.push_back({2, 2, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}}});  // top row first
  build_mips(texture);
  ASSERT_EQ(texture.levels.size(), 2u);
  EXPECT_EQ(texture.levels[1].texels[0], (Vec3f{0.5f, 0.5f, 0.5f}));
  ViewCamera camera;
  camera.x = {1, 0, 0};
  camera.y = {0, 1, 0};
  camera.z = {0, 0, 1};
  camera.centre = {0.5, 0.5, 0};
  camera.radius = 0.75;
  const Picture picture = draw(look_at(scene, camera, 60), {texture});
  auto at = [&](int x, int y) {
    return picture.linear[static_cast<std::size_t>(y) * 60 + static_cast<std::size_t>(x)];
  };
  EXPECT_GT(at(15, 15).x, 0.9);  // red: u = 0, v = 0, top left of the image, where y is high
  EXPECT_LT(at(15, 15).y, 0.1);
  EXPECT_GT(at(44, 15).y, 0.9);
  EXPECT_GT(at(15, 44).z, 0.9);
  EXPECT_GT(at(44, 44).x, 0.9);
}

TEST(RenderView, FinePatternsAreFilteredNotAliased) {
  // A checkerboard of single texels, seen at 1/16 of its size, is even grey.
  Mesh mesh = testing::sheet(1, 0);
  std::vector<std::uint32_t> source(2, 0);
  std::vector<Material> materials(1);
  materials[0].unlit = true;
  ViewScene scene{&mesh, &mesh.triangles, &source, &materials, {0}, {-1}, {{512, 512}}};
  MipTexture texture;
  texture.width_px = texture.height_px = 512;
  texture.levels.push_back({512, 512, {}});
  for (int i = 0; i < 512 * 512; ++i) {
    const float c = static_cast<float>((i + i / 512) % 2);
    texture.levels[0].texels.push_back({c, c, c});
  }
  build_mips(texture);
  ViewCamera camera{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.5, 0.5, 0}, 0.75};
  const Picture picture = draw(look_at(scene, camera, 48), {texture});
  for (int i = 12; i < 36; ++i)
    EXPECT_NEAR(picture.linear[static_cast<std::size_t>(i) * 48 + 24].x, 0.5, 0.01);
}

Picture grey(float level, std::uint32_t side = 32) {
  return {side, std::vector<Vec3f>(side * side, {level, level, level}),
          std::vector<std::uint8_t>(side * side, 1)};
}

TEST(ImageCompare, EqualIsEqualAndColoursCount) {
  const ComparedPicture a = prepare_comparison(grey(0.2f));
  const PictureDifference same = compare_pictures(a, a);
  EXPECT_EQ(same.pixels, 1024u);
  EXPECT_NEAR(same.ssim / 1024, 1, 1e-9);
  EXPECT_EQ(same.difference, 0);

  const PictureDifference lighter = compare_pictures(a, prepare_comparison(grey(0.22f)));
  const PictureDifference bright = compare_pictures(a, prepare_comparison(grey(0.6f)));
  EXPECT_GT(lighter.difference, 0);
  EXPECT_GT(bright.difference, 3 * lighter.difference);

  Picture red = grey(0.2f);
  for (Vec3f& c : red.linear) c = {0.5f, 0.12f, 0.12f};
  const PictureDifference hue = compare_pictures(a, prepare_comparison(red));
  EXPECT_GT(hue.difference / 1024, 0.2);
}

// The largest difference that FLIP knows, by definition nearly 1 (green against blue).
TEST(ImageCompare, GreenAgainstBlueIsOne) {
  Picture green = grey(0), blue = grey(0);
  for (Vec3f& c : green.linear) c = {0, 1, 0};
  for (Vec3f& c : blue.linear) c = {0, 0, 1};
  const PictureDifference d = compare_pictures(prepare_comparison(green), prepare_comparison(blue));
  EXPECT_NEAR(d.difference / 1024, 1, 1e-3);
}

TEST(ImageCompare, OnlyCoveredPixelsCount) {
  Picture a = grey(0.2f), b = grey(0.2f);
  std::fill(a.covered.begin(), a.covered.end(), 0);
  std::fill(b.covered.begin(), b.covered.end(), 0);
  EXPECT_EQ(compare_pictures(prepare_comparison(a), prepare_comparison(b)).pixels, 0u);
  a.covered[5] = 1;
  b.covered[9] = 1;
  EXPECT_EQ(compare_pictures(prepare_comparison(a), prepare_comparison(b)).pixels, 2u);
}

}  // namespace
}  // namespace texmesh
