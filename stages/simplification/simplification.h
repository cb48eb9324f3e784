#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "format/base/fields.h"
#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/condition/condition.h"
#include "stages/ssf/ssf.h"

namespace texmesh {

inline constexpr int kSimplificationVersion = 5;

enum class CollapseOrder : std::uint8_t { kTexmesh, kQem, kThesis };
template <>
struct EnumNames<CollapseOrder> {
  static constexpr std::array<std::string_view, 3> names{"texmesh", "qem", "thesis"};
};

struct SimplificationOptions {
  CollapseOrder order = CollapseOrder::kTexmesh;
  // Cost x (1 + weight * p). At 0.05 one model of twelve is worse than meshoptimizer's at 10 % of the
  // vertices.
  double persistence_weight = 0.035;
  double uv_weight = 0.06;      // of the UV quadric against the geometric one
  double normal_weight = 0.01;  // of the normals' quadric; one radian counts as a mean edge
  double colour_weight = 0.1;  // of the vertex colours' quadric; a full step counts as a 20th of the diagonal
  double boundary_weight = 3;  // of the border quadrics
  double seam_weight = 1;      // of the same at seams of the texture
  // Of the diagonal: no collapse with a larger quadric error, no scale that deviates more
  // (NestedScale::deviation). At half of it
  // scans cut into scraps keep no scale but S_0.
  double max_error = 0.05;
  double max_shift = 0.05;  // of the diagonal: no collapse that shifts the texture by more
  int min_triangles = 100;  // no scale is asked to go below
  // Where much persists (many small components: a saxophone keeps 15 % at S_20) the scale map alone gives no
  // scale small enough for a first picture; targets are then scaled down geometrically so that the coarsest
  // is asked for this share.
  double coarsest = 0.03;  // of S_0's vertices; 1 = the scale map's counts as they are; not for order thesis
  // A scale below this would be good for a thumbnail of 50..100 px and save 2..4 kB; as a first picture it
  // shows corners for outlines and blurs faces.
  int coarsest_vertices = 400;  // no scale is asked for fewer where S_0 has 20 times as many; else 1 / 20
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("order", s.order,
      "texmesh = quadrics weighted by persistence; qem = quadrics alone; thesis = scale map, closest "
      "neighbour");
    v("persistence_weight", s.persistence_weight, Range{0, 10},
      "cost of removing a vertex grows by this per scale it persists");
    v("uv_weight", s.uv_weight, Range{0, 10}, "weight of the texture's distortion against the shape's");
    v("normal_weight", s.normal_weight, Range{0, 10}, "weight of the normals' distortion");
    v("colour_weight", s.colour_weight, Range{0, 10}, "weight of the vertex colours' distortion");
    v("seam_weight", s.seam_weight, Range{0, 1000}, "weight of seams of the texture");
    v("boundary_weight", s.boundary_weight, Range{0, 1000}, "weight of open borders");
    v("max_error", s.max_error, Range{0.0001, 1},
      "no scale deviates more than this fraction of the diagonal; of what vanishes as a whole the size "
      "counts");
    v("max_shift", s.max_shift, Range{0.0001, 1},
      "no collapse shifts the texture by more than this fraction of the diagonal");
    v("coarsest", s.coarsest, Range{0.0001, 1},
      "share of the vertices that the coarsest scale is asked for at most");
    v("coarsest_vertices", s.coarsest_vertices, Range{0, 1000000},
      "no scale is asked for fewer vertices, nor for less than a 20th of them where that is less still");
    v("min_triangles", s.min_triangles, Range{1, 1000000}, "no scale is asked to have fewer triangles");
  }
};

/// One half-edge collapse: position `from` merges into its neighbour `to`, which does not move. Where a whole
/// component vanishes, all positions it has left go at once, each with `to` == `from`, one record behind the
/// other, and so do the triangles it has left.
struct Collapse {
  std::uint32_t from = 0, to = 0;
  float error = 0;  // object units: square root of the quadric error
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

/// Half-edge collapse towards the vertex targets that the scale map gives (target of S_i = #{p >= i}, see
/// SimplificationOptions::coarsest), seam- and
/// border-safe: a collapse needs a consistent wedge map, the link condition, no flipped normal or UV
/// triangle (in every set of texture coordinates that its material uses; the set of the base colour has the
/// quadric and max_shift); border vertices move along the border only, seams along the seam, twins together.
/// Deterministic: ties by place along a space-filling curve. About 5 us per
/// removed vertex on one core. Throws StageError when the scale map is of another mesh.
NestedScales simplify(const ConditionedMesh& mesh, const ScaleMap& scale_map,
                      const SimplificationOptions& options, const RunContext& context);

/// The mesh of one scale with unused positions and wedges dropped; materials, parts and attributes carried
/// over.
Mesh extract_scale(const NestedScales& scales, const NestedScale& scale);

}  // namespace texmesh
