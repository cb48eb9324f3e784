#pragma once
#include "format/model/model.h"

namespace texmesh {

/// One half-edge collapse: position `from` merges into its neighbour `to`, which does not move. A component
/// that vanishes whole has one record for each position that it has left, one behind the other; its triangles
/// go with them.
struct Collapse {
  std::uint32_t from = 0, to = 0;  // equal where the position vanishes with its component
  float error = 0;                 // square root of the quadric error, object units
  static Collapse with_component(std::uint32_t position, float error) { return {position, position, error}; }
  bool vanishes_with_component() const { return to == from; }
  static void archive(auto& s, auto& a) { a(s.from, s.to, s.error); }
};

/// One scale S_i. Triangles index the wedges of NestedScales::mesh.
struct NestedScale {
  int scale = 0;                     // scale number, 0 = S_0
  std::uint32_t collapse_count = 0;  // how many of the collapses lead here
  std::vector<Triangle> triangles;
  // Per triangle: the index of the S_0 triangle that it comes from, whose material and part it has.
  std::vector<std::uint32_t> triangle_source;
  std::uint32_t position_count = 0;  // positions in use
  // The distance between S_0 and S_i, sampled both ways, object units.
  float error_max = 0, error_rms = 0;
  // What max_error bounds: error_max, but for components that have vanished whole. Of these no place counts
  // as farther from S_i than the component's diagonal: a pebble that is too small to be seen may be far from
  // all else.
  float deviation = 0;
  // Why the scale has more vertices than asked for, or why no coarser scale follows; "" when neither is so.
  std::string floor_reason;
  static void archive(auto& s, auto& a) {
    a(s.scale, s.collapse_count, s.triangles, s.triangle_source, s.position_count, s.error_max, s.error_rms,
      s.deviation, s.floor_reason);
  }
};

/// Nested scales: the positions of a coarse scale are a subset of those of every finer one, and no UV is new.
struct NestedScales {
  Mesh mesh;  // S_0; the wedges of relaxed junctions stand behind the conditioned mesh's
  std::vector<std::uint32_t> twin;  // as ConditionedMesh::twin
  std::vector<Collapse> collapses;
  // S_0 first, then coarser ones. Scales that would repeat a mesh (within 3 % of the triangles) or deviate by
  // more than max_error are left out.
  std::vector<NestedScale> scales;
  Notes notes;
  static void archive(auto& s, auto& a) { a(s.mesh, s.twin, s.collapses, s.scales, s.notes); }
};

/// The mesh of one scale, without the positions and wedges that it does not use. Materials, parts and
/// attributes are those of S_0.
Mesh extract_scale(const NestedScales& scales, const NestedScale& scale);

struct ScaleFile {
  int scale = 0;                              // scale number
  std::vector<std::uint8_t> glb;              // glTF 2.0 binary; empty: the stream alone has the scale
  std::uint32_t triangles = 0, vertices = 0;  // as stored: a vertex is a wedge
  static void archive(auto& s, auto& a) { a(s.scale, s.glb, s.triangles, s.vertices); }
};

struct ScaleFiles {
  std::vector<ScaleFile> files;        // the kept scales, S_0 first
  int position_bits = 0, uv_bits = 0;  // as used; 0 = float
  double position_error = 0;           // the largest rounding of a coordinate, object units
  std::vector<std::uint8_t> stream;    // mesh/stream.bin; empty when there is none
  Notes notes;
  static void archive(auto& s, auto& a) {
    a(s.files, s.position_bits, s.uv_bits, s.position_error, s.stream, s.notes);
  }
};

}  // namespace texmesh
