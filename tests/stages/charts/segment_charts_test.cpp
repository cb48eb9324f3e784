#include "stages/charts/charts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>

#include "format/base/vec.h"
#include "stages/charts/chart_parts.h"
#include "tests/stages/proxies/proxy_shapes.h"

namespace texmesh::segment_charts_test {

using testing::Soup;
using testing::soup_of;

std::array<Vec3d, 3> corners_of(const ProxySurface& s, std::size_t t) {
  std::array<Vec3d, 3> out;
  for (std::size_t k = 0; k < 3; ++k) out[k] = to_double(s.positions[s.triangles[t][k]]);
  return out;
}

/// What SurfaceCharts promises of places and sizes.
void expect_sound(const ProxySurface& s, const SurfaceCharts& charts) {
  ASSERT_EQ(charts.chart_of.size(), s.triangles.size());
  ASSERT_EQ(charts.plane.size(), 3 * s.triangles.size());
  ASSERT_EQ(charts.size.size(), charts.chart_count);
  struct Vertex {
    std::uint32_t chart, position;
    Vec2d place;
    bool operator==(const Vertex&) const = default;
  };
  std::map<std::uint32_t, Vertex> vertices;
  std::vector<double> area(charts.chart_count, 0), flat_area(area), stretch(area);
  std::vector<std::uint32_t> group(charts.chart_count, kNoIndex);
  std::uint32_t seen = 0;
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    const std::uint32_t c = charts.chart_of[t];
    ASSERT_LE(c, seen);
    if (c == seen) group[seen++] = s.group[t];
    EXPECT_EQ(group[c], s.group[t]);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2d p = charts.plane[3 * t + k];
      const Vertex vertex{c, s.triangles[t][k], p};
      EXPECT_TRUE(vertices.try_emplace(charts.vertex_of[3 * t + k], vertex).first->second == vertex);
      EXPECT_TRUE(p.x >= 0 && p.x <= charts.size[c].x && p.y >= 0 && p.y <= charts.size[c].y);
    }
    const OwnPlane own(corners_of(s, t));
    const FlatStretch f = flat_stretch(own, &charts.plane[3 * t]);
    EXPECT_GT(f.area, 0);
    EXPECT_LE(f.largest2, 9.0001 * f.least2);
    area[c] += own.area();
    flat_area[c] += f.area;
    stretch[c] += own.area() * (1 / f.least2 + 1 / f.largest2) / 2;
  }
  EXPECT_EQ(seen, charts.chart_count);
  EXPECT_EQ(vertices.size(), charts.vertex_count);
  EXPECT_TRUE(vertices.empty() || vertices.rbegin()->first + 1 == charts.vertex_count);
  for (std::uint32_t c = 0; c < charts.chart_count; ++c) {
    EXPECT_NEAR(flat_area[c] / area[c], 1, 1e-6);
    EXPECT_LE(std::sqrt(stretch[c] / area[c]), 1.2501);
  }
}

bool inside(const Vec2d* t, Vec2d p) {
  return cross(t[1] - t[0], p - t[0]) > 0 && cross(t[2] - t[1], p - t[1]) > 0 &&
         cross(t[0] - t[2], p - t[2]) > 0;
}

/// No triangle holds the middle of another of its chart, and no chart's places are covered twice on a grid.
void expect_no_overlap(const ProxySurface& s, const SurfaceCharts& charts) {
  constexpr int kGrid = 48;
  for (std::uint32_t c = 0; c < charts.chart_count; ++c)
    for (int i = 0; i < kGrid; ++i)
      for (int j = 0; j < kGrid; ++j) {
        const Vec2d p{charts.size[c].x * (i + 0.37) / kGrid, charts.size[c].y * (j + 0.61) / kGrid};
        int hits = 0;
        for (std::size_t t = 0; t < s.triangles.size(); ++t)
          hits += charts.chart_of[t] == c && inside(&charts.plane[3 * t], p);
        ASSERT_LE(hits, 1);
      }
}

TEST(SegmentCharts, SurfacesOfManyKindsBecomeSoundCharts) {
  testing::Random random{9};
  std::vector<Soup> soups{soup_of(testing::bumpy_sphere(16, 32, 0.2f)),
                          testing::torus(20, 12),
                          soup_of(testing::sheet(12, 0.3f)),
                          testing::moebius_strip(24),
                          testing::book(7),
                          soup_of(testing::cube()),
                          soup_of(testing::sliver_sheet(10)),
                          soup_of(testing::dust(30, 0.1f)),
                          soup_of(testing::random_soup(random, 40, 300))};
  for (int i = 0; i < 12; ++i) soups.push_back(soup_of(testing::random_soup(random, 9, 60, 3)));
  for (const Soup& soup : soups) {
    const ProxySurface s = soup.surface();
    const SurfaceCharts charts = segment_charts(s, RunContext{});
    expect_sound(s, charts);
    expect_no_overlap(s, charts);
  }
}

TEST(SegmentCharts, AFlatSheetIsOneChartOfItsOwnShape) {
  const ProxySurface s = soup_of(testing::sheet(10, 0)).surface();
  const SurfaceCharts charts = segment_charts(s, RunContext{});
  ASSERT_EQ(charts.chart_count, 1u);
  EXPECT_NEAR(charts.size[0].x, 1, 1e-6);
  EXPECT_NEAR(charts.size[0].y, 1, 1e-6);
}

TEST(SegmentCharts, PleatsUnfoldWithoutStretch) {
  // Steps of 70 degrees up and down: no projection shows both sides of a pleat well.
  const ProxySurface s =
      testing::quad_rows(6, 4, [](std::uint32_t i, std::uint32_t j) {
        return Vec3f{static_cast<float>(j), 0.9f * static_cast<float>(i % 2), 0.3f * static_cast<float>(i)};
      }).surface();
  const SurfaceCharts charts = segment_charts(s, RunContext{});
  ASSERT_EQ(charts.chart_count, 1u);
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    const FlatStretch f = flat_stretch(OwnPlane(corners_of(s, t)), &charts.plane[3 * t]);
    EXPECT_NEAR(f.largest2, 1, 1e-6);
    EXPECT_NEAR(f.least2, 1, 1e-6);
  }
}

TEST(SegmentCharts, ATubeIsCutAndUnrolled) {
  const ProxySurface s = testing::quad_rows(3, 12, [](std::uint32_t i, std::uint32_t j) {
                           const double a = 6.283185307179586 * (j % 12) / 12;
                           return to_float(Vec3d{std::cos(a), std::sin(a), 0.7 * i});
                         }).surface();
  ASSERT_EQ(s.positions.size(), 48u);
  const SurfaceCharts charts = segment_charts(s, RunContext{});
  EXPECT_EQ(charts.chart_count, 1u);
  EXPECT_EQ(charts.vertex_count, 52u);  // the cut's positions have two vertices each
}

TEST(SegmentCharts, ACubeIsTwoChartsAtMost) {
  const ProxySurface s = soup_of(testing::cube()).surface();
  EXPECT_LE(segment_charts(s, RunContext{}).chart_count, 2u);
}

TEST(SegmentCharts, FewChartsForASmoothSphere) {
  const ProxySurface s = soup_of(testing::sphere(24, 48)).simplified({1000}).front();
  EXPECT_LE(segment_charts(s, RunContext{}).chart_count, 14u);
}

TEST(SegmentCharts, NoChartIsMirrored) {
  // A front that looks along +z: x to the right is y up turned clockwise.
  const ProxySurface s = Soup{{{0, 0, 0}, {2, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}, {}}.surface();
  const SurfaceCharts charts = segment_charts(s, RunContext{});
  EXPECT_GT(cross(charts.plane[1] - charts.plane[0], charts.plane[2] - charts.plane[0]), 0);
}

TEST(SegmentCharts, GroupsAndComponentsStayApart) {
  Soup soup = soup_of(testing::sheet(8, 0));
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) soup.group.push_back(t < 64);
  EXPECT_EQ(segment_charts(soup.surface(), RunContext{}).chart_count, 2u);
  const Soup two = soup_of(testing::side_by_side({testing::sheet(4, 0), testing::sheet(4, 0)}));
  EXPECT_EQ(segment_charts(two.surface(), RunContext{}).chart_count, 2u);
}

TEST(SegmentCharts, SheetsThatMeetInAPointStayApart) {
  const Soup bow{{{0, 0, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {-1, -1, 0}}, {{0, 1, 2}, {0, 3, 4}}, {}};
  EXPECT_EQ(segment_charts(bow.surface(), RunContext{}).chart_count, 2u);
}

TEST(SegmentCharts, ChartsGoOnThroughAnEdgeOfFourTriangles) {
  // Two planes that cross in an edge: each is one chart.
  const Soup crossing{{{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {-1, 0, 0}, {0, 0, 1}, {0, 0, -1}},
                      {{0, 2, 1}, {0, 1, 3}, {0, 4, 1}, {0, 1, 5}},
                      {}};
  const SurfaceCharts charts = segment_charts(crossing.surface(), RunContext{});
  ASSERT_EQ(charts.chart_count, 2u);
  EXPECT_EQ(charts.chart_of[0], charts.chart_of[1]);
  EXPECT_EQ(charts.chart_of[2], charts.chart_of[3]);
}

TEST(SegmentCharts, TwoRunsGiveTheSameBytes) {
  const ProxySurface s = soup_of(testing::bumpy_sphere(20, 40, 0.2f)).surface();
  RunContext many;
  many.threads = 8;
  const SurfaceCharts a = segment_charts(s, RunContext{}), b = segment_charts(s, many);
  EXPECT_EQ(a.chart_of, b.chart_of);
  EXPECT_EQ(a.plane, b.plane);
  EXPECT_EQ(a.size, b.size);
  EXPECT_EQ(a.vertex_of, b.vertex_of);
}

TEST(SegmentCharts, NothingIsNoChart) {
  EXPECT_EQ(segment_charts(ProxySurface{}, RunContext{}).chart_count, 0u);
}

TEST(SegmentCharts, IsCancelled) {
  const std::atomic<bool> stop{true};
  RunContext context;
  context.cancelled = &stop;
  EXPECT_THROW(segment_charts(soup_of(testing::cube()).surface(), context), Cancelled);
}

}  // namespace texmesh::segment_charts_test
