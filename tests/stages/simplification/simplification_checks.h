#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "stages/base/run_context.h"
#include "stages/condition/condition.h"
#include "stages/simplification/simplification.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

inline const RunContext kOneThread{};

/// About 3/4 of the vertices of a scale live on in the next, at random.
inline ScaleMap random_scale_map(std::size_t positions, int scales = 12) {
  ScaleMap map;
  map.scales = scales;
  Random random{7};
  for (std::size_t p = 0; p < positions; ++p) {
    int i = 0;
    while (i < scales && random.uniform() < 0.72) ++i;
    map.persistence.push_back(static_cast<std::uint8_t>(i));
  }
  return map;
}

inline ConditionedMesh condition(const Mesh& mesh) { return condition_mesh(mesh, false, {}, kOneThread); }

inline NestedScales run(const ConditionedMesh& mesh, SimplificationOptions options = {}, int scales = 12) {
  options.min_triangles = std::min(options.min_triangles, 20);
  options.coarsest_vertices = 0;
  return simplify(mesh, random_scale_map(mesh.mesh.positions.size(), scales), options, kOneThread);
}

struct EdgeCounts {
  std::size_t border = 0, non_manifold = 0;
};

/// Of the surface with twins welded.
inline EdgeCounts count_edges(const NestedScales& scales, const NestedScale& scale) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> faces;
  for (const Triangle& t : scale.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = scales.twin[scales.mesh.wedge_position[t[k]]];
      const std::uint32_t b = scales.twin[scales.mesh.wedge_position[t[(k + 1) % 3]]];
      ++faces[std::minmax(a, b)];
    }
  EdgeCounts counts;
  for (const auto& [edge, n] : faces) {
    if (n == 1) ++counts.border;
    if (n > 2) ++counts.non_manifold;
  }
  return counts;
}

inline double uv_turn(const Mesh& m, const Triangle& t) {
  const Vec2d a = to_double(m.uv0[t[0]]);
  return cross(to_double(m.uv0[t[1]]) - a, to_double(m.uv0[t[2]]) - a);
}

/// What holds for every result: nested positions, no new UV, no degenerate triangle, no crack, sound
/// bookkeeping. `flat`: the error may be nothing; `touching`: there may be more borders, and edges of many
/// faces.
inline void expect_sound(const NestedScales& scales, bool flat = false, bool touching = false) {
  ASSERT_FALSE(scales.scales.empty());
  const Mesh& m = scales.mesh;
  EXPECT_EQ(scales.scales[0].scale, 0);
  EXPECT_EQ(scales.scales[0].triangles, m.triangles);
  const EdgeCounts input = count_edges(scales, scales.scales[0]);
  std::set<std::pair<float, float>> uvs;
  for (const Triangle& t : m.triangles)
    for (std::uint32_t w : t)
      if (!m.uv0.empty()) uvs.insert({m.uv0[w].x, m.uv0[w].y});
  std::set<std::uint32_t> finer, removed;
  for (std::uint32_t p = 0; p < m.positions.size(); ++p) finer.insert(p);
  std::size_t applied = 0;
  for (std::size_t k = 0; k < scales.scales.size(); ++k) {
    const NestedScale& s = scales.scales[k];
    if (k > 0) {
      EXPECT_GT(s.scale, scales.scales[k - 1].scale);
      EXPECT_LT(s.triangles.size(), scales.scales[k - 1].triangles.size());
    }
    for (; applied < s.collapse_count; ++applied) {
      const Collapse& c = scales.collapses[applied];
      EXPECT_TRUE(removed.insert(c.from).second);
      EXPECT_TRUE(c.vanishes_with_component() || !removed.count(c.to));
      EXPECT_GE(c.error, 0);
    }
    ASSERT_EQ(s.triangles.size(), s.triangle_source.size());
    EXPECT_TRUE(std::is_sorted(s.triangle_source.begin(), s.triangle_source.end()));
    std::set<std::uint32_t> used;
    for (std::size_t i = 0; i < s.triangles.size(); ++i) {
      const Triangle& t = s.triangles[i];
      std::set<std::uint32_t> places;
      for (std::uint32_t w : t) {
        ASSERT_LT(w, m.wedge_count());
        used.insert(m.wedge_position[w]);
        places.insert(scales.twin[m.wedge_position[w]]);
        EXPECT_TRUE(m.uv0.empty() || uvs.count({m.uv0[w].x, m.uv0[w].y}));
      }
      EXPECT_EQ(places.size(), 3u);
      const double before = m.uv0.empty() ? 0 : uv_turn(m, m.triangles[s.triangle_source[i]]);
      if (before != 0) {
        EXPECT_GT(before * uv_turn(m, t), 0);
      }
    }
    EXPECT_EQ(used.size(), s.position_count);
    EXPECT_TRUE(std::includes(finer.begin(), finer.end(), used.begin(), used.end()));
    for (std::uint32_t p : used) EXPECT_FALSE(removed.count(p));
    finer = used;
    const EdgeCounts counts = count_edges(scales, s);
    EXPECT_TRUE(touching || counts.border <= input.border) << "scale " << s.scale;
    EXPECT_TRUE(touching || counts.non_manifold <= input.non_manifold) << "scale " << s.scale;
    EXPECT_TRUE(k == 0 || s.error_max > 0 || flat);
    EXPECT_LE(s.error_rms, s.error_max);
  }
}

}  // namespace texmesh::testing
