#pragma once
#include <cstdint>
#include <string_view>

#include "format/base/fields.h"
#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/condition/uv_sets.h"

namespace texmesh {

/// Raise when equal inputs may give other bytes; part of the cache key. (The same holds for every
/// k...Version.)
inline constexpr int kConditionVersion = 2;

enum class NormalsPolicy : std::uint8_t { kAuto, kKeep, kSmooth };
template <>
struct EnumNames<NormalsPolicy> {
  static constexpr std::array<std::string_view, 3> names{"auto", "keep", "smooth"};
};

struct ConditionOptions {
  double weld_distance = 0;  // fraction of the bounding-box diagonal; 0 welds bit-equal positions only
  NormalsPolicy normals = NormalsPolicy::kAuto;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("weld_distance", s.weld_distance, Range{0, 0.001},
      "positions closer than this fraction of the diagonal become one; 0 = only equal ones");
    v("normals", s.normals,
      "keep = as in the source; smooth = area-weighted where the source has none; auto = keep for glTF (flat "
      "without "
      "normals, as its specification says), smooth for other formats");
  }
};

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

/// Cleans a mesh without changing what a viewer sees: every triangle that covers area keeps its three points
/// and the attributes at its corners. Order of positions, wedges and triangles follows the input; what a
/// split adds comes last. Triangles of opposite orientation on the same three points (two-sided sheets) are
/// both kept and split apart, and so are triangles on the same three points with different attributes or
/// materials (decals). A triangle with three different corners but no area stays where two of its edges have
/// neighbours: dropped, it would leave a T-junction. Normals are made unit length; UVs that are not finite
/// become 0, colours 1. `normals_by_specification`: the source format defines what absent normals mean
/// (glTF), see ConditionOptions. Throws StageError when no triangle with an area is left, or an index or
/// array length of `mesh` is wrong. Deterministic; O(n log n).
ConditionedMesh condition_mesh(const Mesh& mesh, bool normals_by_specification,
                               const ConditionOptions& options, const RunContext& context);

}  // namespace texmesh
