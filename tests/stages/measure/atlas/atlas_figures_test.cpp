#include "stages/measure/atlas/atlas_figures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "format/base/vec.h"
#include "tests/support/meshes.h"

namespace texmesh::testing::atlas_figures_test {

/// Unit squares side by side along x, two triangles each, in rectangles of a texture: (u0, v0) at the left
/// lower corner.
struct Squares {
  Mesh mesh;
  void add(float u0, float v0, float u1, float v1, std::uint16_t material = 0) {
    const auto n = static_cast<std::uint32_t>(mesh.triangles.size() / 2);
    if (mesh.positions.empty()) mesh.positions = {{0, 0, 0}, {0, 1, 0}};
    const auto x = static_cast<float>(n + 1);
    mesh.positions.push_back({x, 0, 0});
    mesh.positions.push_back({x, 1, 0});
    const auto w = static_cast<std::uint32_t>(mesh.wedge_position.size());
    for (const std::uint32_t p : {2 * n, 2 * n + 2, 2 * n + 3, 2 * n + 1}) mesh.wedge_position.push_back(p);
    for (const Vec2f uv : {Vec2f{u0, v0}, Vec2f{u1, v0}, Vec2f{u1, v1}, Vec2f{u0, v1}})
      mesh.uv0.push_back(uv);
    mesh.triangles.push_back({w, w + 1, w + 2});
    mesh.triangles.push_back({w, w + 2, w + 3});
    mesh.triangle_material.insert(mesh.triangle_material.end(), 2, material);
    mesh.triangle_part.insert(mesh.triangle_part.end(), 2, 0);
  }
};

Material textured(std::int32_t image = 0) {
  Material m;
  m.base_colour_texture.image = image;
  return m;
}

AtlasReport report_of(const Mesh& mesh, std::vector<Material> materials = {textured()},
                      std::vector<AtlasImage> images = {{64, 32, nullptr}}, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return measure_atlases(mesh, materials, images, context);
}

AtlasFigures figures_of(const Mesh& mesh, std::vector<Material> materials = {textured()},
                        std::vector<AtlasImage> images = {{64, 32, nullptr}}) {
  const AtlasReport report = report_of(mesh, std::move(materials), std::move(images));
  EXPECT_EQ(report.atlases.size(), 1u);
  return report.atlases.at(0);
}

TEST(AtlasFigures, ASquareOnHalfATexture) {
  Squares s;
  s.add(0, 1, 0.5f, 0);  // v grows downwards: as the picture is seen
  const AtlasFigures f = figures_of(s.mesh);
  EXPECT_EQ(f.charts, 1u);
  EXPECT_EQ(f.triangles, 2u);
  EXPECT_EQ(f.small_charts, 1u);
  EXPECT_EQ(f.thin_charts, 0u);
  EXPECT_EQ(f.mirrored_charts, 0u);
  EXPECT_EQ(f.cover, 0.5);
  EXPECT_EQ(f.overlap, 0);
  EXPECT_EQ(f.largest_chart, 1);
  EXPECT_DOUBLE_EQ(f.density.p50, 32);  // 32 x 32 texels
  EXPECT_DOUBLE_EQ(f.density_spread(), 1);
  EXPECT_DOUBLE_EQ(f.stretch.p99, 1);
  EXPECT_EQ(f.flat_triangles + f.folded_triangles + f.far_triangles, 0u);
  EXPECT_EQ(f.edges, 1u);
  EXPECT_EQ(f.seam_edges, 0u);
  EXPECT_EQ(f.positions, 4u);
  EXPECT_EQ(f.vertices, 4u);
  EXPECT_EQ(f.triangle_floor, 1u);  // nothing but the mesh's own border: no corner
  EXPECT_FALSE(f.seam_colours);
}

TEST(AtlasFigures, SeamsPartCharts) {
  Squares s;
  s.add(0, 1, 0.25f, 0);
  s.add(0.25f, 1, 0.5f, 0);  // goes on in the texture
  s.add(0.75f, 1, 1, 0);     // does not
  const AtlasFigures f = figures_of(s.mesh);
  EXPECT_EQ(f.charts, 2u);
  EXPECT_EQ(f.cover, 0.75);
  EXPECT_EQ(f.edges, 5u);
  EXPECT_EQ(f.seam_edges, 1u);
  EXPECT_EQ(f.positions, 8u);
  EXPECT_EQ(f.vertices, 10u);
  EXPECT_DOUBLE_EQ(f.largest_chart, 2.0 / 3);
  const AtlasReport report = report_of(s.mesh);
  EXPECT_EQ(report.chart_of_triangle, (std::vector<std::uint32_t>{0, 0, 0, 0, 1, 1}));
  EXPECT_EQ(report.charts[0].triangles, 4u);
  EXPECT_EQ(report.charts[0].corners, 2u);  // three lines meet at both ends of the seam
  EXPECT_EQ(report.charts[1].corners, 2u);
}

TEST(AtlasFigures, ACubeOfSixCharts) {
  Mesh mesh = cube();
  const AtlasReport report = report_of(mesh, {textured()}, {{300, 200, nullptr}});
  const AtlasFigures& f = report.atlases.at(0);
  EXPECT_EQ(f.charts, 6u);
  EXPECT_EQ(f.seam_edges, 12u);
  EXPECT_EQ(f.edges, 18u);
  EXPECT_EQ(f.positions, 8u);
  EXPECT_EQ(f.vertices, 24u);
  for (const ChartFigures& c : report.charts) EXPECT_EQ(c.corners, 4u);
  EXPECT_EQ(f.triangle_floor, 12u);  // a cube has no coarser mesh with six square charts
}

TEST(AtlasFigures, TexelsOfTwoPlacesOverlap) {
  Squares s;
  s.add(0, 1, 0.5f, 0);
  s.add(0.25f, 1, 0.5f, 0);
  const AtlasFigures f = figures_of(s.mesh);
  EXPECT_EQ(f.cover, 0.5);
  EXPECT_EQ(f.overlap, 0.5);
  const AtlasReport report = report_of(s.mesh);
  const std::vector<AtlasImage> images{{64, 32, nullptr}};
  const AtlasMap map = map_atlas(s.mesh, {textured()}, images, report, 0, 64, {});
  EXPECT_EQ(map.width_px, 64u);
  EXPECT_EQ(std::ranges::count(map.layers, 2), 16 * 32);
  EXPECT_EQ(map.chart[0], 0u);
  EXPECT_EQ(map.chart[20], 1u);
  EXPECT_EQ(map.chart[40], kNoIndex);
  EXPECT_EQ(map_atlas(s.mesh, {textured()}, images, report, 0, 20, {}).width_px, 16u);
}

TEST(AtlasFigures, MirroredAndFolded) {
  Squares s;
  s.add(0.5f, 1, 0, 0);
  EXPECT_EQ(figures_of(s.mesh).mirrored_charts, 1u);
  EXPECT_EQ(figures_of(s.mesh).folded_triangles, 0u);
  Squares folded;
  folded.add(0, 1, 0.5f, 0);
  folded.add(0.5f, 1, 0.75f, 0);
  folded.mesh.uv0[3] = {0.4f, 0.9f};  // over the diagonal
  const AtlasFigures f = figures_of(folded.mesh);
  EXPECT_EQ(f.folded_triangles, 1u);
  EXPECT_GT(f.overlap, 0);
}

TEST(AtlasFigures, ThinIsThinnerThanEightTexels) {
  for (const float width : {4.0f, 7.0f, 8.0f, 20.0f}) {
    Squares s;
    s.add(0, 1, width / 64, 0);
    const AtlasReport report = report_of(s.mesh);
    EXPECT_NEAR(report.charts.at(0).width_texels(), static_cast<double>(width), 1e-6);
    EXPECT_EQ(report.charts[0].is_thin(), width < 8) << width;
    EXPECT_EQ(report.atlases[0].thin_share, width < 8 ? 1 : 0);
  }
  EXPECT_EQ(ChartFigures{}.width_texels(), 0);
  ChartFigures round;
  round.texels = 100;
  EXPECT_EQ(round.width_texels(), 10);  // rounder than a square
}

TEST(AtlasFigures, StretchAndDensityByTexels) {
  Squares s;
  s.add(0, 1, 1, 0);  // 64 x 32 texels on a unit square
  const AtlasFigures f = figures_of(s.mesh);
  EXPECT_NEAR(f.stretch.p50, 2, 1e-12);
  EXPECT_NEAR(f.density.p50, std::sqrt(64.0 * 32), 1e-9);
  s.add(0, 0.25f, 0.25f, 0);
  EXPECT_NEAR(figures_of(s.mesh).density_spread(), 4, 1e-9);
}

TEST(AtlasFigures, WrappingMovesWholeTiles) {
  Squares s;
  s.add(10, -6, 10.5f, -7);
  Material m = textured();
  EXPECT_EQ(figures_of(s.mesh, {m}).cover, 0.5);
  m.base_colour_texture.wrap_s = m.base_colour_texture.wrap_t = Wrap::kMirror;
  EXPECT_EQ(figures_of(s.mesh, {m}).cover, 0.5);
  m.base_colour_texture.wrap_s = m.base_colour_texture.wrap_t = Wrap::kClamp;
  EXPECT_EQ(figures_of(s.mesh, {m}).cover, 0);  // all of it reads the last texel
  Squares tiled;
  tiled.add(0.5f, 3, 3, 0);
  const AtlasFigures f = figures_of(tiled.mesh);
  EXPECT_EQ(f.cover, 1);
  EXPECT_EQ(f.overlap, 1);
  EXPECT_EQ(f.far_triangles, 0u);
}

TEST(AtlasFigures, TransformsAndSecondCoordinatesCount) {
  Squares s;
  s.add(0, 1, 1, 0);
  Material m = textured();
  m.base_colour_texture.transform.scale = {0.5f, 0.5f};
  EXPECT_EQ(figures_of(s.mesh, {m}).cover, 0.25);
  s.mesh.uv1 = s.mesh.uv0;
  for (Vec2f& uv : s.mesh.uv0) uv = {0, 0};
  m = textured();
  EXPECT_EQ(figures_of(s.mesh, {m}).flat_triangles, 2u);
  EXPECT_EQ(figures_of(s.mesh, {m}).flat_surface, 1);
  EXPECT_EQ(figures_of(s.mesh, {m}).cover, 0);
  m.base_colour_texture.texcoord = 1;
  EXPECT_EQ(figures_of(s.mesh, {m}).cover, 1);
}

TEST(AtlasFigures, SeamsCompareWhatViewersRead) {
  Pixels halves{64, 32, 3, {}};
  for (std::uint32_t i = 0; i < 64 * 32; ++i) halves.data.insert(halves.data.end(), 3, i % 64 < 32 ? 0 : 255);
  const std::vector<AtlasImage> images{{64, 32, &halves}};
  Squares s;
  s.add(0, 1, 0.25f, 0);
  s.add(0.75f, 1, 1, 0);
  const AtlasFigures f = figures_of(s.mesh, {textured()}, images);
  ASSERT_TRUE(f.seam_colours);
  EXPECT_NEAR(f.seam_colours->mean, 100, 0.01);  // black beside white
  EXPECT_NEAR(f.seam_colours->p95, 100, 0.01);
  EXPECT_NEAR(f.seam_colours->inside, 0, 0.01);
  Squares same;
  same.add(0, 1, 0.2f, 0);
  same.add(0.1f, 1, 0.3f, 0);
  EXPECT_NEAR(figures_of(same.mesh, {textured()}, images).seam_colours->mean, 0, 0.01);
  EXPECT_EQ(figures_of(same.mesh, {textured()}, images).seam_edges, 1u);
}

TEST(AtlasFigures, ImagesAndMaterials) {
  Squares s;
  s.add(0, 1, 0.5f, 0, 0);
  s.add(0.5f, 1, 1, 0, 1);  // goes on in the texture, but is another material
  s.add(0, 1, 1, 0, 2);
  s.add(0, 1, 1, 0, 3);
  const std::vector<AtlasImage> images{{8, 8, nullptr}, {64, 32, nullptr}, {4, 4, nullptr}};
  const AtlasReport r = report_of(s.mesh, {textured(1), textured(1), textured(0), Material{}}, images);
  ASSERT_EQ(r.atlases.size(), 2u);
  EXPECT_EQ(r.atlases[0].image, 0u);
  EXPECT_EQ(r.atlases[1].image, 1u);
  EXPECT_EQ(r.atlases[1].materials, (std::vector<std::uint32_t>{0, 1}));
  EXPECT_EQ(r.atlases[1].charts, 2u);
  EXPECT_EQ(r.atlases[1].cover, 1);
  EXPECT_EQ(r.untextured_triangles, 2u);
  EXPECT_EQ(r.chart_of_triangle.back(), kNoIndex);
}

TEST(AtlasFigures, NothingToLookAt) {
  Squares s;
  s.add(0, 1, 1, 0);
  EXPECT_TRUE(report_of(s.mesh, {Material{}}).atlases.empty());
  EXPECT_TRUE(report_of(s.mesh, {textured()}, {{0, 0, nullptr}}).atlases.empty());
  s.mesh.uv0.clear();
  const AtlasReport r = report_of(s.mesh);
  EXPECT_TRUE(r.atlases.empty());
  EXPECT_EQ(r.untextured_triangles, 2u);
  EXPECT_TRUE(report_of(Mesh{}).atlases.empty());
}

TEST(AtlasFigures, HostileCoordinates) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kMost = std::numeric_limits<float>::max();
  for (const Vec2f bad : {Vec2f{kNan, 0}, Vec2f{kMost, -kMost}, Vec2f{-1e30f, 0}, Vec2f{1e5f, 1e5f}}) {
    Squares s;
    s.add(0, 1, 0.5f, 0);
    s.mesh.uv0[0] = bad;  // both triangles have it
    const AtlasFigures f = figures_of(s.mesh);
    EXPECT_EQ(f.far_triangles, 2u);
    EXPECT_EQ(f.cover, 0);
    for (const double value : {f.density.p95, f.stretch.p95, f.thin_share, f.largest_chart, f.flat_surface})
      EXPECT_TRUE(std::isfinite(value));
  }
  Squares s;  // two corners at one place: no edges, no chart
  s.add(0, 1, 0.5f, 0);
  s.mesh.triangles.push_back({0, 0, 1});
  s.mesh.triangle_material.push_back(0);
  s.mesh.triangle_part.push_back(0);
  EXPECT_EQ(figures_of(s.mesh).charts, 1u);
  EXPECT_EQ(report_of(s.mesh).chart_of_triangle.back(), kNoIndex);
}

TEST(AtlasFigures, ManyLayersOfTheWholeTextureAreFilledCoarsely) {
  Squares s;
  for (int k = 0; k < 3000; ++k) s.add(0, 60, 60, 0);  // 60 x 60 tiles each
  const AtlasFigures f = figures_of(s.mesh, {textured()}, {{8192, 8192, nullptr}});
  EXPECT_EQ(f.cover, 1);
  EXPECT_EQ(f.overlap, 1);
}

/// Any order of triangles, any number of threads: the same atlas.
TEST(AtlasFigures, PropertiesOfAllKindsOfMeshes) {
  Random random{7};
  Mesh torn = bumpy_sphere(12, 16);
  for (Vec2f& uv : torn.uv0)
    uv = {static_cast<float>(random.uniform()), static_cast<float>(random.uniform())};
  for (Mesh mesh : {cube(), sphere(8, 12), sheet(9), torn, side_by_side({cube(), sheet(4), sphere(5, 7)})}) {
    const std::vector<AtlasImage> images{{128, 64, nullptr}};
    const AtlasReport a = report_of(mesh, {textured()}, images), b = report_of(mesh, {textured()}, images, 8);
    ASSERT_EQ(a.atlases.size(), 1u);
    const AtlasFigures& f = a.atlases[0];
    for (const double share : {f.cover, f.overlap, f.thin_share, f.largest_chart, f.flat_surface}) {
      EXPECT_GE(share, 0);
      EXPECT_LE(share, 1);
    }
    std::uint64_t in_charts = 0;
    for (const ChartFigures& c : a.charts) in_charts += c.triangles;
    EXPECT_EQ(in_charts, mesh.triangles.size());
    EXPECT_EQ(f.triangles, mesh.triangles.size());
    EXPECT_EQ(f.charts, a.charts.size());
    EXPECT_LE(f.small_charts, f.charts);
    EXPECT_LE(f.thin_charts, f.charts);
    EXPECT_LE(f.seam_edges, f.edges);
    EXPECT_LE(f.positions, f.vertices);
    EXPECT_GE(f.triangle_floor, f.charts);
    EXPECT_LE(f.density.p5, f.density.p50);
    EXPECT_LE(f.stretch.p50, f.stretch.p99);
    EXPECT_GE(f.stretch.p5, 1 - 1e-9);
    EXPECT_EQ(b.chart_of_triangle, a.chart_of_triangle);
    EXPECT_EQ(b.atlases[0].density.p50, f.density.p50);
    std::ranges::reverse(mesh.triangles);
    const AtlasFigures back = figures_of(mesh, {textured()}, images);
    EXPECT_EQ(back.charts, f.charts);
    EXPECT_EQ(back.cover, f.cover);
    EXPECT_EQ(back.overlap, f.overlap);
    EXPECT_EQ(back.triangle_floor, f.triangle_floor);
    EXPECT_EQ(back.stretch.p95, f.stretch.p95);
  }
}

/// Triangles that share an edge share no texel and leave none out, however they are turned.
TEST(AtlasFigures, ASheetIsFilledExactlyOnce) {
  const Mesh mesh = sheet(23);
  for (const float turn : {0.0f, 0.3f, 1.1f}) {
    Material m = textured();
    m.base_colour_texture.transform.rotation = turn;
    m.base_colour_texture.wrap_s = m.base_colour_texture.wrap_t = Wrap::kClamp;
    const AtlasFigures f = figures_of(mesh, {m}, {{157, 131, nullptr}});
    EXPECT_EQ(f.overlap, 0) << turn;
    EXPECT_GT(f.cover, 0.05) << turn;
    if (turn == 0) EXPECT_EQ(f.cover, 1);
  }
}

}  // namespace texmesh::testing::atlas_figures_test
