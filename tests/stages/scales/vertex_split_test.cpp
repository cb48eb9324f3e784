#include "stages/scales/vertex_split.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "format/base/sha256.h"
#include "format/split/split_reader.h"
#include "format/split/split_writer.h"
#include "stages/condition/condition.h"
#include "stages/gltf/scale_codecs.h"
#include "stages/scales/scales.h"
#include "stages/simplification/simplification.h"
#include "tests/format/split/split_fixture.h"
#include "tests/support/hostile_meshes.h"
#include "tests/support/meshes.h"

namespace texmesh::vertex_split_test {

using testing::bumpy_sphere;
using testing::Corners;
using testing::count_split_edges;
using testing::sheet;
using testing::SplitEdges;

const RunContext kOneThread{};

NestedScales simplified(const Mesh& mesh, int scales = 10, CollapseOrder order = CollapseOrder::kTexmesh) {
  const ConditionedMesh conditioned = condition_mesh(mesh, false, {}, kOneThread);
  ScaleMap map;
  map.scales = scales;
  testing::Random random{7};
  for (std::size_t p = 0; p < conditioned.mesh.positions.size(); ++p) {
    int i = 0;
    while (i < scales && random.uniform() < 0.7) ++i;
    map.persistence.push_back(static_cast<std::uint8_t>(i));
  }
  SimplificationOptions options;
  options.order = order;
  options.min_triangles = 10;
  return simplify(conditioned, map, options, kOneThread);
}

VertexSplitCoding coding_of(const Mesh& mesh) {
  VertexSplitCoding coding;
  const ScalesOptions options;
  coding.position = position_grid(mesh, options, 24);
  if (!mesh.uv0.empty()) coding.uv[0] = uv_grid(mesh.uv0, 1024, options, 24);
  if (!mesh.uv1.empty()) coding.uv[1] = uv_grid(mesh.uv1, 1024, options, 24);
  coding.colour_bits = mesh.colours.empty() ? 0 : 8;
  return coding;
}

/// Corners of a scale as its file would have them: rounded on the same grids.
Corners corners_of(const NestedScales& scales, const NestedScale& scale, const VertexSplitCoding& coding,
                   const std::vector<SplitGroup>& groups) {
  Corners list;
  const Mesh& m = scales.mesh;
  for (std::size_t i = 0; i < scale.triangles.size(); ++i) {
    std::array<std::vector<std::int32_t>, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t w = scale.triangles[i][k];
      const Vec3f p = m.positions[m.wedge_position[w]];
      const auto put = [&](std::uint32_t x) { corners[k].push_back(static_cast<std::int32_t>(x)); };
      for (int axis = 0; axis < 3; ++axis) put(coding.position.index(p[axis], axis));
      if (!m.uv0.empty()) put(coding.uv[0].index(m.uv0[w].x, 0)), put(coding.uv[0].index(m.uv0[w].y, 1));
      if (!m.uv1.empty()) put(coding.uv[1].index(m.uv1[w].x, 0)), put(coding.uv[1].index(m.uv1[w].y, 1));
      if (!m.normals.empty())
        for (std::int32_t x :
             octahedral_code({m.normals[w].x, m.normals[w].y, m.normals[w].z}, coding.normal_bits))
          corners[k].push_back(x);
      if (!m.colours.empty())
        for (float x : {m.colours[w].x, m.colours[w].y, m.colours[w].z, m.colours[w].w})
          put(static_cast<std::uint32_t>(std::floor(x * 255 + 0.5f)));
    }
    const std::uint32_t source = scale.triangle_source[i];
    const SplitGroup group{m.triangle_material[source], m.triangle_part[source]};
    const auto at = std::find(groups.begin(), groups.end(), group);
    testing::add_corners(list, static_cast<std::int32_t>(at - groups.begin()), std::move(corners));
  }
  std::sort(list.begin(), list.end());
  return list;
}

/// Every kept scale decodes to its own triangles; every block leaves a mesh with three points per face and no
/// more borders or non-manifold edges than the coarser and finer of the scales around it, unless surfaces
/// touch.
void expect_stream(const NestedScales& scales, const std::vector<std::size_t>& kept, bool touching) {
  const VertexSplitCoding coding = coding_of(scales.mesh);
  SplitSource source = make_vertex_splits(scales, kept, coding, kOneThread);
  source.splits_per_block = 40;
  const std::vector<std::uint8_t> stream = write_split_stream(source);
  const SplitStreamHead head = read_split_head(stream);
  ASSERT_EQ(head.scales.size(), kept.size());
  SplitStreamReader reader(head), finest(head);
  finest.read_to_scale(kept.size() - 1, stream);
  const SplitEdges most = count_split_edges(finest.mesh());
  std::size_t scale = 0;
  for (std::size_t i = 0; i < head.blocks.size(); ++i) {
    const SplitBlock& b = head.blocks[i];
    reader.add_block(std::span(stream).subspan(b.offset, b.bytes()));
    const SplitMesh& mesh = reader.mesh();
    for (std::uint32_t f = 0; f < mesh.face_count(); ++f)
      for (std::uint32_t k = 0; k < 3; ++k) ASSERT_NE(mesh.point_at(f, k), mesh.point_at(f, k + 1));
    if (!b.is_patch && !touching) {
      const SplitEdges edges = count_split_edges(mesh);
      EXPECT_LE(edges.border, most.border);
      EXPECT_LE(edges.non_manifold, most.non_manifold);
    }
    if (i + 1 != head.scales[scale].blocks) continue;
    const NestedScale& expected = scales.scales[kept[kept.size() - 1 - scale]];
    EXPECT_EQ(head.scales[scale].scale, expected.scale);
    EXPECT_EQ(testing::corners_of(mesh), corners_of(scales, expected, coding, source.groups))
        << "scale " << expected.scale;
    ++scale;
  }
}

void expect_stream(const NestedScales& scales, bool touching = false) {
  std::vector<std::size_t> all, some{0};
  for (std::size_t k = 0; k < scales.scales.size(); ++k) all.push_back(k);
  for (std::size_t k = 3; k < scales.scales.size(); k += 3) some.push_back(k);
  expect_stream(scales, all, touching);
  expect_stream(scales, some, touching);
}

TEST(VertexSplit, ClosedSurfaceWithSeamAndNormals) {
  const NestedScales scales = simplified(bumpy_sphere(24, 36));
  ASSERT_GE(scales.scales.size(), 5u);
  expect_stream(scales);
}

TEST(VertexSplit, OpenSheetWithoutUv) {
  Mesh m = sheet(20);
  m.uv0.clear();
  expect_stream(simplified(m));
}

TEST(VertexSplit, MaterialsPartsTwoUvSetsAndColours) {
  Mesh m = bumpy_sphere(20, 28);
  m.part_names = {"body", "cap"};
  for (std::size_t t = 0; t < m.triangles.size(); ++t) {
    const Vec3f p = m.positions[m.position_of(static_cast<std::uint32_t>(t), 0)];
    m.triangle_material[t] = p.x > 0 ? 1 : 0;
    m.triangle_part[t] = p.y > 0.5f ? 1 : 0;
  }
  for (std::size_t w = 0; w < m.wedge_count(); ++w) {
    const Vec3f p = m.positions[m.wedge_position[w]];
    m.uv1.push_back({p.x, p.y - p.z});
    m.colours.push_back({std::clamp(p.x, 0.0f, 1.0f), std::clamp(p.y, 0.0f, 1.0f), 0.25f, 1});
  }
  expect_stream(simplified(m));
}

/// A bumpy sphere of many small charts.
Mesh many_charts(std::size_t triangles_of_a_chart = 8) {
  const Mesh m = bumpy_sphere(20, 30);
  Mesh charts = m;
  charts.wedge_position.clear(), charts.uv0.clear(), charts.normals.clear();
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> ids;
  for (std::size_t t = 0; t < m.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t w = m.triangles[t][k];
      const auto chart = static_cast<std::uint32_t>(t / triangles_of_a_chart);
      const auto [it, fresh] =
          ids.try_emplace({w, chart}, static_cast<std::uint32_t>(charts.wedge_position.size()));
      if (fresh) {
        charts.wedge_position.push_back(m.wedge_position[w]);
        charts.uv0.push_back({m.uv0[w].x + static_cast<float>(chart), m.uv0[w].y});
      }
      charts.triangles[t][k] = it->second;
    }
  return charts;
}

/// Three pages at one spine.
Mesh open_book() {
  Mesh book;
  for (int k = 0; k < 3; ++k) {
    const Mesh page = sheet(10, 0.02f);
    const auto base = static_cast<std::uint32_t>(book.positions.size());
    const double c = k == 0 ? 1 : k == 1 ? 0.5 : -0.5, s = std::sqrt(1 - c * c);
    for (const Vec3f p : page.positions)
      book.positions.push_back(to_float(Vec3d{p.x * c, p.y, p.x * (s + p.z)}));
    for (std::size_t w = 0; w < page.wedge_count(); ++w) {
      book.wedge_position.push_back(base + page.wedge_position[w]);
      book.uv0.push_back({page.uv0[w].x + static_cast<float>(k), page.uv0[w].y});
    }
    for (const Triangle& t : page.triangles)
      book.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  }
  book.triangle_material.assign(book.triangles.size(), 0);
  book.triangle_part.assign(book.triangles.size(), 0);
  book.part_names = {"book"};
  return book;
}

TEST(VertexSplit, ManySmallChartsWithRelaxedJunctions) { expect_stream(simplified(many_charts())); }

/// A split leaves wedges at its parent that no face has any more.
TEST(VertexSplit, AStreamMayHaveMoreWedgesThanItsFacesHaveCorners) {
  const NestedScales scales = simplified(many_charts(1));
  const SplitScale last =
      read_split_head(write_split_stream(make_vertex_splits(scales, {0, scales.scales.size() - 1},
                                                            coding_of(scales.mesh), kOneThread)))
          .scales.back();
  EXPECT_GT(last.wedges, 3 * last.faces);
  expect_stream(scales);
}

TEST(VertexSplit, NonManifoldSpineAndDoubledSheets) {
  const NestedScales scales = simplified(open_book());
  bool twins = false;
  for (std::size_t p = 0; p < scales.twin.size(); ++p) twins = twins || scales.twin[p] != p;
  EXPECT_TRUE(twins);
  expect_stream(scales);

  Mesh doubled = sheet(9, 0.1f);
  const std::size_t n = doubled.triangles.size();
  for (std::size_t t = 0; t < n; ++t)
    doubled.triangles.push_back({doubled.triangles[t][0], doubled.triangles[t][2], doubled.triangles[t][1]});
  doubled.triangle_material.resize(2 * n), doubled.triangle_part.resize(2 * n);
  expect_stream(simplified(doubled));
}

TEST(VertexSplit, SurfacesThatTouch) {
  for (const Mesh& mesh : {testing::sieve(15), open_book(), many_charts()})
    expect_stream(simplified(mesh, 10, CollapseOrder::kTouching), true);
  for (std::uint64_t round = 1; round <= 10; ++round) {
    testing::Random random{round};
    expect_stream(simplified(testing::random_soup(random, 60, 300, 5), 10, CollapseOrder::kTouching), true);
  }
}

/// As if whole components had vanished: their faces leave the coarser scales without a collapse.
TEST(VertexSplit, ComponentsThatVanishComeBack) {
  NestedScales scales = simplified(testing::side_by_side({bumpy_sphere(14, 20), sheet(8), testing::cube()}));
  ASSERT_GE(scales.scales.size(), 4u);
  const std::size_t half = scales.scales.size() / 2;
  for (std::size_t k = 1; k < scales.scales.size(); ++k) {
    NestedScale& s = scales.scales[k];
    const float limit = k >= half ? 2.4f : 3.6f;  // the cube goes at once, the sheet later
    NestedScale kept = s;
    kept.triangles.clear(), kept.triangle_source.clear();
    for (std::size_t i = 0; i < s.triangles.size(); ++i) {
      if (scales.mesh.positions[scales.mesh.wedge_position[s.triangles[i][0]]].x > limit) continue;
      kept.triangles.push_back(s.triangles[i]);
      kept.triangle_source.push_back(s.triangle_source[i]);
    }
    ASSERT_LT(kept.triangles.size(), s.triangles.size());
    s = kept;
  }
  expect_stream(scales);
}

TEST(VertexSplit, FacesThatTheGridFlattensAreKeptForConnectivityOnly) {
  NestedScales scales = simplified(bumpy_sphere(24, 36));
  VertexSplitCoding coding = coding_of(scales.mesh);
  coding.position.bits = 4;
  std::vector<std::size_t> kept;
  for (std::size_t k = 0; k < scales.scales.size(); ++k) kept.push_back(k);
  const SplitSource source = make_vertex_splits(scales, kept, coding, kOneThread);
  const std::vector<std::uint8_t> stream = write_split_stream(source);
  SplitStreamReader reader(read_split_head(stream));
  for (std::size_t k = 0; k < kept.size(); ++k) {
    reader.read_to_scale(k, stream);
    EXPECT_EQ(testing::corners_of(reader.mesh()),
              corners_of(scales, scales.scales[kept.size() - 1 - k], coding, source.groups));
  }
  EXPECT_LT(reader.head().scales.back().triangles, reader.head().scales.back().faces);
}

/// Streams whose decoded scales are equal may still differ: in the order of a point's corners, or in which of
/// equal wedges stands for them. Another simplification gives other digests.
TEST(VertexSplit, BytesStayTheSame) {
  const auto digest = [](const NestedScales& scales) {
    std::vector<std::size_t> kept;
    for (std::size_t k = 0; k < scales.scales.size(); ++k) kept.push_back(k);
    return to_hex(
        sha256(write_split_stream(make_vertex_splits(scales, kept, coding_of(scales.mesh), kOneThread))));
  };
  EXPECT_EQ(digest(simplified(bumpy_sphere(24, 36))),
            "ea8b5c1b355c284b486dc282caaa306a27230887962d729aa9d45bccf9a3e8cb");
  EXPECT_EQ(digest(simplified(many_charts())),
            "917846db0c6d084f1ab14b51ecef6128981f76345009476d939b337ad5433cc5");
  EXPECT_EQ(digest(simplified(open_book())),
            "87c8f439b78df869bff0fb8e6297ab2501dcff72c8d2eedf54c6c3c3725639fe");
}

TEST(VertexSplit, RefusesScalesOfOtherCollapses) {
  NestedScales scales = simplified(sheet(12));
  std::swap(scales.collapses.front(), scales.collapses.back());
  std::vector<std::size_t> kept;
  for (std::size_t k = 0; k < scales.scales.size(); ++k) kept.push_back(k);
  EXPECT_THROW(make_vertex_splits(scales, kept, coding_of(scales.mesh), kOneThread), StageError);
  EXPECT_THROW(make_vertex_splits(scales, {}, coding_of(scales.mesh), kOneThread), StageError);
  scales.collapses.resize(scales.collapses.size() / 2);
  EXPECT_THROW(make_vertex_splits(scales, kept, coding_of(scales.mesh), kOneThread), StageError);
}

}  // namespace texmesh::vertex_split_test
