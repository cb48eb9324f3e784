#pragma once
#include "stages/data/conditioned_mesh.h"
#include "stages/data/nested_scales.h"
#include "stages/data/scale_map.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kSimplificationVersion = 12;

enum class CollapseOrder : std::uint8_t { kTexmesh, kThesis, kTouching };
template <>
struct EnumNames<CollapseOrder> {
  static constexpr std::array<std::string_view, 3> names{"texmesh", "thesis", "touching"};
};

struct SimplificationOptions {
  CollapseOrder order = CollapseOrder::kTexmesh;
  // Cost x (1 + weight * p). At 0.05 one model of twelve is worse than meshoptimizer's at 10 % of the
  // vertices.
  double persistence_weight = 0.035;
  // Weights of texture and normals are set by lit pictures of a turtle, a saxophone, an apple and a bust (see
  // tests/bench/lit_simplify_bench.cpp): mean FLIP falls by 1 % against 0.06 and 0.01, on the bust by 5 %.
  // Normals at 0.2 and over cost a smooth apple 10 %.
  double uv_weight = 0.15;
  // One radian counts as a mean edge; 8 times as much in models with tangents.
  double normal_weight = 0.05;
  double colour_weight = 0.1;  // a full step counts as a 20th of the diagonal
  double boundary_weight = 3;
  double seam_weight = 1;
  // Bounds the quadric error of every collapse, too. At half of it scans cut into scraps keep no scale but
  // S_0.
  double max_error = 0.05;
  double max_shift = 0.05;
  int min_triangles = 100;
  // Where much persists (many small components: a saxophone keeps 15 % at S_20) the scale map alone gives no
  // scale small enough for a first picture. The targets are then scaled down geometrically so that the
  // coarsest one is this share. 1 = the scale map's counts as they are, which order thesis always takes.
  double coarsest = 0.03;
  // A smaller scale would be good for a thumbnail of 50..100 px and save 2..4 kB. As a first picture it shows
  // corners for outlines and blurs faces.
  int coarsest_vertices = 400;
  static void fields(auto& s, auto&& v) {
    v("order", s.order, ProfileOnly{},
      "texmesh = quadrics weighted by persistence; thesis = scale map, closest neighbour; touching = as texmesh, but "
      "where no collapse is left tunnels close, and borders and seams move");
    v("persistence_weight", s.persistence_weight, Range{0, 10}, ProfileOnly{},
      "cost of removing a vertex grows by this per scale it persists; 0 = quadrics alone");
    v("uv_weight", s.uv_weight, Range{0, 10}, ProfileOnly{},
      "weight of the texture's distortion against the shape's");
    v("normal_weight", s.normal_weight, Range{0, 10}, ProfileOnly{}, "weight of the normals' distortion");
    v("colour_weight", s.colour_weight, Range{0, 10}, ProfileOnly{},
      "weight of the vertex colours' distortion");
    v("seam_weight", s.seam_weight, Range{0, 1000}, ProfileOnly{}, "weight of seams of the texture");
    v("boundary_weight", s.boundary_weight, Range{0, 1000}, ProfileOnly{}, "weight of open borders");
    v("max_error", s.max_error, Range{0.0001, 1},
      "no scale deviates by more than this fraction of the diagonal; a component that vanishes deviates by "
      "its size; order thesis has no such bound");
    v("max_shift", s.max_shift, Range{0.0001, 1}, ProfileOnly{},
      "no collapse shifts the texture by more than this fraction of the diagonal");
    v("coarsest", s.coarsest, Range{0.0001, 1},
      "most vertices that the coarsest scale is asked to have, as a share of all");
    v("coarsest_vertices", s.coarsest_vertices, Range{0, 1000000},
      "no scale is asked to have fewer vertices than this, or than a 20th of all where that is less");
    v("min_triangles", s.min_triangles, Range{1, 1000000}, "no scale is asked to have fewer triangles");
  }
};

/// Half-edge collapses down to the numbers of vertices that the scale map gives: target of S_i = #{p >= i},
/// see SimplificationOptions::coarsest.
/// - A collapse needs a consistent wedge map and the link condition, and turns no normal or UV triangle over,
///   in every set of texture coordinates that its material uses. The set of the base colour has the quadric
///   and max_shift.
/// - Order thesis removes down to the scale map's numbers, whatever the error and the shift of the texture.
/// - Order touching collapses as texmesh does until nothing is left. From then on surfaces may touch in
/// points
///   and lines, and double sheets without thickness may vanish. Positions that stay keep a triangle.
/// - Border vertices move along the border only, seams along the seam, twins together. Borders of materials
///   are seams; where parts of one material share wedges, what shows is one surface and nothing is held.
/// About 5 us per removed vertex on one core. StageError when the scale map is of another mesh.
/// Deterministic: among equals the place along a space-filling curve decides.
NestedScales simplify(const ConditionedMesh& mesh, const ScaleMap& scale_map,
                      const SimplificationOptions& options, const RunContext& context);

/// Fills error_max, error_rms and deviation of all scales but the first, S_0: distances of 500 to 4,000
/// points spread over S_0 to S_i and over S_i to S_0, and, for the largest, of S_0's vertices. `component`:
/// per position. Each scale takes time linear in S_0's positions, collapses and the scale's triangles, plus a
/// fixed number of distances.
void measure_scale_errors(const std::vector<std::uint32_t>& component, NestedScales& scales,
                          const RunContext& context);

}  // namespace texmesh
