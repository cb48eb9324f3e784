#pragma once

#include "stages/data/conditioned_mesh.h"
#include "stages/data/stage.h"

namespace texmesh {

/// Part of the cache key: raised when equal inputs may give other bytes, as every k...Version is.
inline constexpr int kConditionVersion = 3;

enum class NormalsPolicy : std::uint8_t { kAuto, kKeep, kSmooth };
template <>
struct EnumNames<NormalsPolicy> {
  static constexpr std::array<std::string_view, 3> names{"auto", "keep", "smooth"};
};

struct ConditionOptions {
  double weld_distance = 0;
  NormalsPolicy normals = NormalsPolicy::kAuto;
  static void fields(auto& s, auto&& v) {
    v("weld_distance", s.weld_distance, Range{0, 0.001},
      "positions closer than this fraction of the diagonal become one; 0 = equal ones, and those at open "
      "edges that differ by rounding alone");
    v("normals", s.normals,
      "keep = as in the source; smooth = area-weighted where the source has none; auto = keep for glTF "
      "(flat without normals, as its specification says), smooth for other formats");
  }
};

/// Cleans a mesh without changing what a viewer sees: every triangle that covers area keeps its three points
/// and the attributes at its corners.
/// - Positions at open edges that differ by the rounding of their source (Mesh::rounding) are one, as
///   weld_rounded() says: chunks with origins or quantisations of their own stay together where they meet.
///   So are their wedges, as weld_rounded_wedges() says.
/// - Positions, wedges and triangles stand in the order of the input; what a split adds comes last.
/// - Triangles of opposite orientation on the same three points (two-sided sheets) are both kept and split
///   apart. So are triangles on the same three points with different attributes or materials (decals).
/// - A triangle with three different corners but no area stays where two of its edges have neighbours:
///   without it there would be a T-junction.
/// - Normals are made unit length. UVs that are not finite become 0, colours 1.
/// `normals_by_specification`: the source format (glTF) defines what absent normals mean, see
/// ConditionOptions. StageError when no triangle with an area is left, or an index or array length of `mesh`
/// is wrong. Deterministic. O(n log n).
ConditionedMesh condition_mesh(const Mesh& mesh, bool normals_by_specification,
                               const ConditionOptions& options, const RunContext& context);

}  // namespace texmesh
