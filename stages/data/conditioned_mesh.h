#pragma once
#include <cstdint>
#include <vector>

#include "format/model/model.h"
#include "stages/data/uv_sets.h"

namespace texmesh {

/// What condition found and changed; but for the three counts marked (*), zero everywhere for a clean mesh.
struct ConditionReport {
  std::uint64_t welded_positions = 0, welded_wedges = 0, unused_positions = 0;
  std::uint64_t degenerate_triangles = 0;  // dropped: two equal corners, or no area and no crack where it was
  std::uint64_t slivers_kept = 0;          // no area, but between neighbours that would gape without it
  std::uint64_t duplicate_triangles = 0;   // dropped: same wedges, direction, material and part as another
  std::uint64_t non_finite_triangles = 0;  // dropped
  std::uint64_t repaired_wedges =
      0;  // with a non-finite UV or colour, or a normal that is not finite or zero
  std::uint64_t split_non_manifold_edges = 0, split_bow_ties = 0;
  std::uint64_t components = 0;      // (*)
  std::uint64_t boundary_edges = 0;  // (*) edges of one triangle, between welded positions, before splits
  std::uint64_t non_manifold_edges_found = 0;  // (*) edges of more than two triangles, likewise
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.welded_positions, s.welded_wedges, s.unused_positions, s.degenerate_triangles, s.slivers_kept,
      s.duplicate_triangles, s.non_finite_triangles, s.repaired_wedges, s.split_non_manifold_edges,
      s.split_bow_ties, s.components, s.boundary_edges, s.non_manifold_edges_found);
  }
};

/// A mesh whose position graph is an orientable 2-manifold with boundary, edge by edge and vertex by vertex:
/// positions welded, wedges unique, no degenerate or duplicate triangle, non-manifold edges and bow-ties
/// split.
struct ConditionedMesh {
  Mesh mesh;
  /// Per position: the lowest index of a position at the very same place (itself when there is no twin).
  /// Twins come from splits; they collapse together later so that no crack opens.
  std::vector<std::uint32_t> twin;
  std::vector<std::uint32_t> component;  // per position: connected component over positions *and* twins
  std::uint32_t component_count = 0;
  std::vector<std::uint32_t> position_source;  // per position: index in the input mesh
  std::vector<std::uint32_t> triangle_source;  // per triangle: index in the input mesh
  std::vector<UvSets> uv_sets;                 // per material, or empty: the first set for all; the caller's
  ConditionReport report;
  Notes notes;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.mesh, s.twin, s.component, s.component_count, s.position_source, s.triangle_source, s.uv_sets,
      s.report, s.notes);
  }
};

}  // namespace texmesh
