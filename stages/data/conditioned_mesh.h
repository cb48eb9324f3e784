#pragma once
#include "format/model/model.h"

namespace texmesh {

/// Which sets of texture coordinates a material's textures use (0 -> uv0, 1 -> uv1).
struct UvSets {
  std::uint8_t guide = 0;  // the base colour's set; where that has no texture, the first texture's
  std::uint8_t both = 0;   // 1 = some texture uses the other set
  friend bool operator==(const UvSets&, const UvSets&) = default;
  static void archive(auto& s, auto& a) { a(s.guide, s.both); }
};

/// Per material; empty when all textures use the first set, as with nearly every model.
std::vector<UvSets> uv_sets_of(const std::vector<Material>& materials);

/// What condition found and changed. For a clean mesh all counts are 0 but the last three.
struct ConditionReport {
  std::uint64_t welded_positions = 0, welded_wedges = 0, unused_positions = 0;
  // Of the welded ones: those that differ by the rounding of their source.
  std::uint64_t rounded_positions = 0;
  // Dropped: two corners are equal, or the triangle has no area and leaves no crack.
  std::uint64_t degenerate_triangles = 0;
  // Kept without an area, since its neighbours would gape without it.
  std::uint64_t slivers_kept = 0;
  // Dropped: another triangle has the same wedges, direction, material and part.
  std::uint64_t duplicate_triangles = 0;
  std::uint64_t non_finite_triangles = 0;  // dropped
  // Of these wedges a UV or a colour was not finite, or a normal was not finite or zero.
  std::uint64_t repaired_wedges = 0;
  std::uint64_t split_non_manifold_edges = 0, split_bow_ties = 0;
  std::uint64_t components = 0;
  // Edges of one triangle and of more than two, between welded positions, before splits.
  std::uint64_t boundary_edges = 0, non_manifold_edges_found = 0;
  static void archive(auto& s, auto& a) {
    a(s.welded_positions, s.rounded_positions, s.welded_wedges, s.unused_positions, s.degenerate_triangles,
      s.slivers_kept, s.duplicate_triangles, s.non_finite_triangles, s.repaired_wedges,
      s.split_non_manifold_edges, s.split_bow_ties, s.components, s.boundary_edges,
      s.non_manifold_edges_found);
  }
};

/// A mesh whose position graph is an orientable 2-manifold with boundary. Positions are welded and wedges are
/// unique. There is no degenerate or duplicate triangle. Non-manifold edges and bow-ties are split.
struct ConditionedMesh {
  Mesh mesh;
  /// Per position: the lowest index of a position at the very same place (itself when there is no twin).
  /// Twins come from splits; they collapse together later so that no crack opens.
  std::vector<std::uint32_t> twin;
  // Per position: its connected component, over which twins count as one.
  std::vector<std::uint32_t> component;
  std::uint32_t component_count = 0;
  std::vector<std::uint32_t> position_source;  // per position: index in the input mesh
  std::vector<std::uint32_t> triangle_source;  // per triangle: index in the input mesh
  // Per material, as the caller has set it. Empty: all materials use the first set.
  std::vector<UvSets> uv_sets;
  ConditionReport report;
  Notes notes;
  static void archive(auto& s, auto& a) {
    a(s.mesh, s.twin, s.component, s.component_count, s.position_source, s.triangle_source, s.uv_sets,
      s.report, s.notes);
  }
};

}  // namespace texmesh
