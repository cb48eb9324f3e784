// Models of which pictures show little or nothing.
#include <gtest/gtest.h>

#include "tests/stages/quality/quality_samples.h"

namespace texmesh::quality_unseen_test {

using namespace testing;  // NOLINT: fixtures

TEST(Quality, PlanesThatDoNotShowLoseNothing) {
  Sample s = sample_sheet(true);
  std::swap(s.materials[0].base_colour_texture, s.materials[0].normal_texture);
  s.fragments.planes[0].role = TextureRole::kNormal;
  encode(s);
  const QualityTable normals = measure(s);
  ASSERT_EQ(normals.groups.size(), 1u);
  EXPECT_GT(normals.groups[0].sizes[0].preview.flip[0], 0.02f) << "bad normals must show";
  s.materials[0].unlit = true;
  const QualityTable unseen = measure(s);
  ASSERT_EQ(unseen.groups.size(), 1u);
  for (const TextureLosses& losses : unseen.groups[0].sizes)
    for (const auto* shown : {&losses.coded, &losses.preview})
      for (const float x : shown->flip) EXPECT_EQ(x, 0);
}

TEST(Quality, WhatIsTransparentIsNotMeasured) {
  Sample s = sample_sheet(true);
  s.materials[0].alpha_mode = AlphaMode::kBlend;
  s.materials[0].base_colour = {1, 1, 1, 0};
  const MeasuredQuality m = measure_all(s, small_options());
  for (const PictureLosses& g : m.table.geometry)
    for (const float x : g.flip) EXPECT_EQ(x, 0);
  EXPECT_EQ(m.display_px_flip.back(), 256);
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
  const Sample alone = sample_sheet(false);
  const MeasuredQuality want = measure_all(alone, small_options());
  EXPECT_TRUE(want.notes.empty());
  for (float away : {300.f, 1e5f}) {
    SCOPED_TRACE(away);
    Sample s = alone;
    add_stray(s, away, 0.02f);
    s.perceptual.object_height = away;
    const MeasuredQuality m = measure_all(s, small_options());
    EXPECT_GT(m.table.geometry[0].flip.back(), 0.3f * want.table.geometry[0].flip.back());
    ASSERT_EQ(m.notes.size(), 1u);
    EXPECT_EQ(m.notes[0].code, "far-outliers");
    EXPECT_NE(m.notes[0].text.find("the 3 of "), std::string::npos) << m.notes[0].text;
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
  specks.scales.mesh.triangle_material = {0};
  specks.scales.mesh.triangle_part = {0};
  add_stray(specks, 1000, 0.01f);
  add_stray(specks, -1000, 0.01f);
  for (const Sample* s : {&thread, &specks}) {
    const MeasuredQuality m = measure_all(*s, small_options());
    for (const PictureLosses& g : m.table.geometry)
      for (float x : g.flip) EXPECT_EQ(x, 0.f);
    EXPECT_EQ(m.display_px_flip.back(), 256);
    ASSERT_EQ(m.notes.size(), 1u);
    EXPECT_EQ(m.notes[0].code, "quality-not-measured");
  }
}

TEST(Quality, NothingToLookAtIsAnError) {
  Sample s = sample_sheet(false);
  for (Vec3f& p : s.scales.mesh.positions) p = {1, 2, 3};
  EXPECT_THROW(measure(s), StageError);
  s.scales.mesh.positions.clear();
  EXPECT_THROW(measure(s), StageError);
}

}  // namespace texmesh::quality_unseen_test
