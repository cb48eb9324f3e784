#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "format/model/model.h"

namespace texmesh {

/// One half-edge collapse: position `from` merges into its neighbour `to`, which does not move. Where a whole
/// component vanishes, all positions it has left go at once, each with `to` == `from`, one record behind the
/// other, and so do the triangles it has left.
struct Collapse {
  std::uint32_t from = 0, to = 0;
  float error = 0;  // object units: square root of the quadric error
  bool vanishes_with_component() const { return to == from; }
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.from, s.to, s.error);
  }
};

/// One scale S_i. Triangles index the wedges of NestedScales::mesh.
struct NestedScale {
  int scale = 0;                     // scale number, 0 = S_0
  std::uint32_t collapse_count = 0;  // how many of the collapses lead here
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t>
      triangle_source;               // per triangle: index of the S_0 triangle it comes from (material, part)
  std::uint32_t position_count = 0;  // positions in use
  float error_max = 0, error_rms = 0;  // distance between S_0 and S_i, sampled both ways, object units
  // What max_error bounds: as error_max, but what has vanished with its whole component counts as no farther
  // from S_i than the component's diagonal: a pebble that is too small to be seen may be far from all others.
  float deviation = 0;
  std::string floor_reason;  // why the scale has more vertices than asked for, or is the coarsest although
                             // more were asked for; "" when neither
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.scale, s.collapse_count, s.triangles, s.triangle_source, s.position_count, s.error_max, s.error_rms,
      s.deviation, s.floor_reason);
  }
};

/// Nested scales: positions of a coarse scale are a subset of those of every finer one, and no UV is ever
/// made.
struct NestedScales {
  Mesh mesh;  // S_0; its wedge table may be longer than the conditioned mesh's (relaxed junctions)
  std::vector<std::uint32_t> twin;  // as ConditionedMesh::twin
  std::vector<Collapse> collapses;
  std::vector<NestedScale> scales;  // S_0 first, then coarser; scales that would repeat a mesh (within 3 % of
                                    // the triangles) or deviate by more than max_error are left out
  Notes notes;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.mesh, s.twin, s.collapses, s.scales, s.notes);
  }
};

/// The mesh of one scale with unused positions and wedges dropped; materials, parts and attributes carried
/// over.
Mesh extract_scale(const NestedScales& scales, const NestedScale& scale);

}  // namespace texmesh
