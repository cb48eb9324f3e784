#include "pipeline/import/mesh_builder.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "pipeline/import/import.h"
#include "pipeline/import/import_images.h"
#include "pipeline/import/text_scan.h"
#include "tests/support/images.h"
#include "tests/support/memory_resolver.h"
#include "tests/support/meshes.h"

namespace texmesh::finish_model_test {

using testing::bytes_of;
using testing::count_notes;
using testing::input_error;
using testing::MemoryResolver;

const float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

Model model_of(Mesh mesh) {
  Model m;
  m.mesh = std::move(mesh);
  return m;
}

Model finished(Model m, const ImportOptions& options = {}) {
  finish_model(m, "f", options);
  return m;
}

TEST(FinishModel, LeavesACleanModelAlone) {
  Model m = model_of(testing::sheet(4));
  m.materials.resize(1);
  const Model before = m;
  m = finished(m);
  EXPECT_EQ(m.mesh.triangles, before.mesh.triangles);
  EXPECT_EQ(m.mesh.positions, before.mesh.positions);
  EXPECT_EQ(m.mesh.uv0, before.mesh.uv0);
  EXPECT_TRUE(m.notes.empty());
  EXPECT_EQ(finished(m), m) << "a second time changes nothing";
}

TEST(FinishModel, KeepsTheImagesThatAreUsedWithTheirBytes) {
  Model m = model_of(testing::cube());
  MemoryResolver resolver;
  for (const char* name : {"a.png", "b.png", "c.png"})
    resolver.files[name] = testing::png_bytes(4 + name[0] - 'a', 4, 3);
  for (const char* name : {"a.png", "b.png", "c.png"})
    add_image(m, {name, "", false}, resolver, "f", "p", {});
  m.materials.resize(3);
  m.materials[2].normal_texture.image = 2;
  m.materials[1].base_colour_texture.image = 1;
  m.materials[0].base_colour_texture.image = 0;
  for (std::size_t t = 0; t < m.mesh.triangles.size(); ++t) m.mesh.triangle_material[t] = t % 2 ? 2 : 0;
  const Model out = finished(m);
  ASSERT_EQ(out.materials.size(), 2u);
  ASSERT_EQ(out.images.size(), 2u);
  EXPECT_EQ(out.images[0], m.images[0]);
  EXPECT_EQ(out.images[1], m.images[2]);
  EXPECT_EQ(out.materials[1].normal_texture.image, 1);
  EXPECT_EQ(out.mesh.triangle_material[1], 1);
}

TEST(FinishModel, NonFiniteValues) {
  Model m = model_of(testing::sphere(6, 8));
  m.mesh.positions[3].y = kNan;
  m.mesh.positions[4].x = kInf;
  m.mesh.uv0[20].x = -kInf;
  m.mesh.normals[30] = {0, 0, 0};
  m.mesh.normals[31] = {kNan, 0, 0};
  m.mesh.normals[32] = {0, 5, 0};
  const std::size_t triangles = m.mesh.triangles.size();
  const Model out = finished(m);
  EXPECT_LT(out.mesh.triangles.size(), triangles);
  EXPECT_EQ(count_notes(out, "non-finite-position"), 1);
  EXPECT_EQ(count_notes(out, "non-finite-uv"), 1);
  for (const Vec3f& p : out.mesh.positions)
    EXPECT_TRUE(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
  for (const Vec2f& uv : out.mesh.uv0) EXPECT_TRUE(std::isfinite(uv.x));
  for (const Vec3f& n : out.mesh.normals) EXPECT_NEAR(length(n), 1, 1e-5);
}

/// The texts name the bound that set_positions() goes by.
TEST(FinishModel, WhatIsLeftOutIsSaidWithTheBound) {
  const double beyond = std::nextafter(kLargestCoordinate, 1e300);
  Model m;
  set_positions(m.mesh, {{0, 0, 0}, {kLargestCoordinate, 0, 0}, {0, 1, 0}, {beyond, 0, 0}});
  m.mesh.wedge_position = {0, 1, 2, 3};
  m.mesh.triangles = {{0, 1, 2}, {0, 3, 2}};
  const Model out = finished(m);
  EXPECT_EQ(out.mesh.triangles.size(), 1u) << "at the bound is not beyond it";
  ASSERT_EQ(count_notes(out, "non-finite-position"), 1);
  EXPECT_EQ(out.notes.front().text,
            "1 triangle left out because of positions that are NaN, infinite or beyond 1e+18");
  m.mesh.triangles = {{0, 3, 2}};
  EXPECT_EQ(
      input_error([&] { finished(m); }),
      "f: positions: expected some finite ones, found NaN, infinity or more than 1e+18 in every triangle");
}

TEST(FinishModel, HardFaults) {
  EXPECT_THROW(finished({}), InputError) << "no triangle";
  Model m = model_of(testing::cube());
  for (Vec3f& p : m.mesh.positions) p.z = kNan;
  EXPECT_NE(input_error([&] { finished(m); }).find("NaN"), std::string::npos);
  for (int fault = 0; fault < 6; ++fault) {
    m = model_of(testing::cube());
    if (fault == 0) m.mesh.triangles[3][1] = 99999;
    if (fault == 1) m.mesh.wedge_position[2] = 8;
    if (fault == 2) m.mesh.uv0.pop_back();
    if (fault == 3) m.mesh.triangle_material[0] = 1;
    if (fault == 4) m.mesh.triangle_part[0] = 1;
    if (fault == 5) m.materials.resize(1), m.materials[0].emissive_texture.image = 0;
    EXPECT_THROW(finished(m), InputError) << fault;
  }
  ImportOptions options;
  options.max_vertices = 7;
  EXPECT_THROW(finished(model_of(testing::cube()), options), InputError);
  options = {};
  options.max_triangles = 11;
  EXPECT_THROW(finished(model_of(testing::cube()), options), InputError);
}

TEST(FinishModel, ZUpTurnsEverything) {
  Model m = model_of(testing::sphere(6, 8));
  m.mesh.origin = {1, 2, 3};
  ImportOptions options;
  options.up = UpAxis::kZ;
  const Model out = finished(m, options);
  EXPECT_EQ(out.mesh.origin, (Vec3d{1, 3, -2}));
  EXPECT_EQ(out.mesh.positions[5],
            (Vec3f{m.mesh.positions[5].x, m.mesh.positions[5].z, -m.mesh.positions[5].y}));
}

/// A triangle at `u` repeats to the right and `v` down, with its own material.
Model chart_at(float u, float v, const TextureRef& texture) {
  Model m;
  m.mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  m.mesh.wedge_position = {0, 1, 2};
  m.mesh.uv0 = {{u + 0.25f, v + 0.5f}, {u + 0.75f, v + 0.5f}, {u + 0.25f, v + 1.5f}};
  m.mesh.triangles = {{0, 1, 2}};
  m.materials.resize(1);
  m.materials[0].base_colour_texture = texture;
  Image image;
  image.bytes = {1};
  m.images.push_back(image);
  return m;
}

TEST(FinishModel, FarChartsMoveNearByWholeRepeats) {
  TextureRef t;
  t.image = 0;
  EXPECT_EQ(finished(chart_at(1553, -721, t)).mesh.uv0, chart_at(0, 0, t).mesh.uv0);
  EXPECT_EQ(finished(chart_at(-1, 1, t)).mesh.uv0, chart_at(-1, 1, t).mesh.uv0) << "near enough";
  t.wrap_s = Wrap::kMirror;
  EXPECT_EQ(finished(chart_at(7, 7, t)).mesh.uv0, chart_at(1, 0, t).mesh.uv0) << "by pairs of repeats";
  t.wrap_s = Wrap::kClamp;
  EXPECT_EQ(finished(chart_at(7, 7, t)).mesh.uv0, chart_at(7, 0, t).mesh.uv0);
  t = {};
  t.image = 0;
  t.transform.scale = {2, 0.5f};
  EXPECT_EQ(finished(chart_at(7, 7, t)).mesh.uv0, chart_at(7, 7, t).mesh.uv0) << "half a repeat would show";
  t.transform.scale = {2, 3};
  EXPECT_EQ(finished(chart_at(7, 7, t)).mesh.uv0, chart_at(0, 0, t).mesh.uv0);
  t.transform.rotation = 1;
  EXPECT_EQ(finished(chart_at(7, 7, t)).mesh.uv0, chart_at(7, 7, t).mesh.uv0);
  t = {};
  t.image = 0;
  const Mesh far = finished(chart_at(1e6f, 1e6f, t)).mesh;
  for (Vec2f uv : far.uv0) EXPECT_LT(std::fabs(uv.x) + std::fabs(uv.y), 4);
}

TEST(FinishModel, TangentsAreMadeSoundAndKeptOnlyWhereTheyCount) {
  TextureRef t;
  t.image = 0;
  Model m = chart_at(0, 0, t);
  m.mesh.normals.assign(3, {0, 0, 1});
  m.mesh.tangents = {{2, 0, 0, 0.5f}, {kNan, 0, 0, 1}, {0, 3, 0, -7}};
  EXPECT_TRUE(finished(m).mesh.tangents.empty()) << "no normal map";
  m.materials[0].normal_texture = t;
  EXPECT_EQ(finished(m).mesh.tangents, (std::vector<Vec4f>{{1, 0, 0, 1}, {0, 0, 0, 0}, {0, 1, 0, -1}}));
  EXPECT_EQ(finished(m, {.up = UpAxis::kZ}).mesh.tangents[2], (Vec4f{0, 0, -1, -1}));
}

}  // namespace texmesh::finish_model_test
