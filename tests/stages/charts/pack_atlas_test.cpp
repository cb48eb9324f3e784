#include "stages/charts/charts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "tests/stages/proxies/proxy_shapes.h"

namespace texmesh::pack_atlas_test {

using testing::Soup;
using testing::soup_of;

/// Per texel: the chart whose triangles touch more than a thousandth of it, or -1. Fails where two do.
class TouchedTexels {
 public:
  explicit TouchedTexels(const AtlasMesh& mesh) : mesh_(mesh), chart_(mesh.width_px * mesh.height_px, -1) {
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) add(t);
  }
  int at(int x, int y) const {
    return chart_[static_cast<std::size_t>(y) * mesh_.width_px + static_cast<std::size_t>(x)];
  }
  /// The least number of texels between two charts.
  int least_gutter(int up_to) const {
    const int width = static_cast<int>(mesh_.width_px), height = static_cast<int>(mesh_.height_px);
    int least = up_to;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        for (int dy = -up_to; dy <= up_to && at(x, y) >= 0; ++dy)
          for (int dx = -up_to; dx <= up_to; ++dx) {
            if (x + dx < 0 || y + dy < 0 || x + dx >= width || y + dy >= height) continue;
            const int other = at(x + dx, y + dy);
            if (other >= 0 && other != at(x, y))
              least = std::min(least, std::max(std::abs(dx), std::abs(dy)) - 1);
          }
    return least;
  }

 private:
  void add(std::size_t t) {
    constexpr int kSteps = 40;  // points of the triangle, tried one by one
    for (int i = 0; i <= kSteps; ++i)
      for (int j = 0; j <= kSteps - i; ++j) {
        Vec2d p;
        const std::array<double, 3> weight{i / 1.0 / kSteps, j / 1.0 / kSteps,
                                           (kSteps - i - j) / 1.0 / kSteps};
        for (std::size_t k = 0; k < 3; ++k) {
          const Vec2f uv = mesh_.uvs[mesh_.triangles[t][k]];
          p = p + Vec2d{uv.x * double(mesh_.width_px), uv.y * double(mesh_.height_px)} * weight[k];
        }
        if (std::fabs(p.x - std::round(p.x)) < 1e-3 || std::fabs(p.y - std::round(p.y)) < 1e-3) continue;
        int& chart = chart_[static_cast<std::size_t>(p.y) * mesh_.width_px + static_cast<std::size_t>(p.x)];
        EXPECT_TRUE(chart < 0 || chart == static_cast<int>(mesh_.chart_of[t]));
        chart = static_cast<int>(mesh_.chart_of[t]);
      }
  }

  const AtlasMesh& mesh_;
  std::vector<int> chart_;
};

double cover_of(const AtlasMesh& mesh) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vec2d a = to_double(mesh.uvs[t[0]]);
    sum -= cross(to_double(mesh.uvs[t[1]]) - a, to_double(mesh.uvs[t[2]]) - a) / 2;
  }
  return sum;
}

/// What AtlasMesh promises, against the surface it shows.
void expect_sound(const ProxySurface& s, const AtlasMesh& mesh) {
  ASSERT_EQ(mesh.triangles.size(), s.triangles.size());
  ASSERT_EQ(mesh.uvs.size(), mesh.positions.size());
  EXPECT_EQ(mesh.group_of, s.group);
  std::vector<int> chart_of_vertex(mesh.positions.size(), -1);
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = mesh.triangles[t][k];
      EXPECT_EQ(mesh.position_of[v], s.triangles[t][k]);
      EXPECT_EQ(mesh.positions[v], s.positions[s.triangles[t][k]]);
      EXPECT_TRUE(chart_of_vertex[v] < 0 || chart_of_vertex[v] == static_cast<int>(mesh.chart_of[t]));
      chart_of_vertex[v] = static_cast<int>(mesh.chart_of[t]);
    }
    const Vec2d a = to_double(mesh.uvs[mesh.triangles[t][0]]);
    EXPECT_LT(
        cross(to_double(mesh.uvs[mesh.triangles[t][1]]) - a, to_double(mesh.uvs[mesh.triangles[t][2]]) - a),
        1e-9);
  }
  EXPECT_EQ(std::count(chart_of_vertex.begin(), chart_of_vertex.end(), -1), 0);
  for (const Vec2f uv : mesh.uvs) EXPECT_TRUE(uv.x >= 0 && uv.x <= 1 && uv.y >= 0 && uv.y <= 1);
}

AtlasMesh atlas_of(const ProxySurface& s, std::uint32_t width_px, std::uint32_t height_px,
                   std::uint32_t gutter_px) {
  const auto mesh =
      pack_atlas(s, segment_charts(s, RunContext{}), width_px, height_px, gutter_px, RunContext{});
  EXPECT_TRUE(mesh);
  return mesh ? *mesh : AtlasMesh{};
}

TEST(PackAtlas, ChartsKeepTheGutterAtEverySize) {
  const ProxySurface s = soup_of(testing::bumpy_sphere(20, 40, 0.3f)).simplified({500}).front();
  for (const auto& [width, height, gutter] :
       {std::array{64u, 64u, 1u}, {128u, 64u, 2u}, {33u, 150u, 0u}, {96u, 96u, 4u}}) {
    const AtlasMesh mesh = atlas_of(s, width, height, gutter);
    expect_sound(s, mesh);
    EXPECT_GE(TouchedTexels(mesh).least_gutter(static_cast<int>(gutter) + 1), static_cast<int>(gutter));
    EXPECT_GT(cover_of(mesh), gutter > 2 ? 0.2 : 0.35);
  }
}

TEST(PackAtlas, ManyChartsStillCoverATextureOf256) {
  const ProxySurface s = soup_of(testing::dust(300, 0.3f)).surface();
  const AtlasMesh mesh = atlas_of(s, 256, 256, 1);
  EXPECT_GT(mesh.chart_count, 200u);
  expect_sound(s, mesh);
  EXPECT_GE(TouchedTexels(mesh).least_gutter(2), 1);
  EXPECT_GT(cover_of(mesh), 0.45);
}

TEST(PackAtlas, ASquareFillsTheTexture) {
  const ProxySurface s = soup_of(testing::sheet(4, 0)).surface();
  EXPECT_GT(cover_of(atlas_of(s, 100, 100, 1)), 0.95);
  EXPECT_GT(cover_of(atlas_of(s, 200, 100, 1)), 0.45);
}

TEST(PackAtlas, TexelsHaveOneSizeOnTheSurface) {
  const ProxySurface s = soup_of(testing::bumpy_sphere(20, 40, 0.3f)).simplified({300}).front();
  const AtlasMesh mesh = atlas_of(s, 512, 512, 1);
  std::vector<double> area(mesh.chart_count, 0), texels(mesh.chart_count, 0);
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    const Triangle& v = mesh.triangles[t];
    const Vec3d a = to_double(mesh.positions[v[0]]);
    area[mesh.chart_of[t]] +=
        length(cross(to_double(mesh.positions[v[1]]) - a, to_double(mesh.positions[v[2]]) - a));
    const Vec2d uv = to_double(mesh.uvs[v[0]]);
    texels[mesh.chart_of[t]] -=
        cross(to_double(mesh.uvs[v[1]]) - uv, to_double(mesh.uvs[v[2]]) - uv) * 512 * 512;
  }
  const double density = cover_of(mesh) * 512 * 512 * 2 / [&] {
    double sum = 0;
    for (const double a : area) sum += a;
    return sum;
  }();
  for (std::uint32_t c = 0; c < mesh.chart_count; ++c)
    if (texels[c] > 800) {
      EXPECT_NEAR(texels[c] / area[c] / density, 1, 0.08);
    }
}

TEST(PackAtlas, LargeTexturesArePackedInCells) {
  const ProxySurface s = soup_of(testing::sphere(20, 40)).simplified({300}).front();
  const AtlasMesh mesh = atlas_of(s, 2048, 1500, 2);
  expect_sound(s, mesh);
  EXPECT_GT(cover_of(mesh), 0.45);
}

TEST(PackAtlas, TooManyChartsForATextureAreRefused) {
  const ProxySurface s = soup_of(testing::dust(300, 0.1f)).surface();
  const SurfaceCharts charts = segment_charts(s, RunContext{});
  EXPECT_FALSE(pack_atlas(s, charts, 16, 16, 1, RunContext{}));
  const auto tight = pack_atlas(s, charts, 40, 40, 1, RunContext{});
  ASSERT_TRUE(tight);
  expect_sound(s, *tight);
  EXPECT_GE(TouchedTexels(*tight).least_gutter(2), 1);
}

TEST(PackAtlas, SmallestInput) {
  const ProxySurface one = Soup{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}, {}}.surface();
  for (const std::uint32_t px : {1u, 2u, 64u}) expect_sound(one, atlas_of(one, px, px, 1));
  const auto none = pack_atlas(ProxySurface{}, SurfaceCharts{}, 64, 64, 1, RunContext{});
  ASSERT_TRUE(none);
  EXPECT_TRUE(none->triangles.empty());
  const ProxySurface needle = Soup{{{0, 0, 0}, {1000, 0, 0}, {0, 1e-3f, 0}}, {{0, 1, 2}}, {}}.surface();
  expect_sound(needle, atlas_of(needle, 64, 16, 1));
}

TEST(PackAtlas, TwoRunsGiveTheSameBytes) {
  const ProxySurface s = soup_of(testing::bumpy_sphere(20, 40, 0.3f)).simplified({400}).front();
  RunContext many;
  many.threads = 8;
  EXPECT_EQ(atlas_of(s, 128, 128, 1), *pack_atlas(s, segment_charts(s, many), 128, 128, 1, many));
}

TEST(PackAtlas, IsCancelled) {
  const ProxySurface s = soup_of(testing::cube()).surface();
  const SurfaceCharts charts = segment_charts(s, RunContext{});
  const std::atomic<bool> stop{true};
  RunContext context;
  context.cancelled = &stop;
  EXPECT_THROW(pack_atlas(s, charts, 64, 64, 1, context), Cancelled);
}

}  // namespace texmesh::pack_atlas_test
