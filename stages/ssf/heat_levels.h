#pragma once
#include <cstdint>
#include <vector>

#include "format/base/vec.h"
#include "stages/ssf/heat_kernel.h"

namespace texmesh {

/// A surface at one level of detail, fine enough for heat that has already flowed further than its spacing.
struct HeatLevel {
  std::vector<std::uint32_t> vertex;   // per vertex: its vertex on the level that this one was made from
  std::vector<Vec3d> points;           // of the original surface
  std::vector<std::uint32_t> corners;  // three vertices per triangle; on coarse levels a vertex may have none
  double spacing = 0;                  // of the vertices, about
  HeatOperator laplacian;
};

/// The level that has every vertex.
HeatLevel finest_level(std::vector<Vec3d> points, std::vector<std::uint32_t> corners, double spacing,
                       double rate_cap);

/// The next coarser level.
/// - Seeds: the vertices in order, each unless a seed is within `radius` along the edges. Every vertex joins
///   its nearest seed (Voronoi cells by Dijkstra); ties go to the earlier seed.
/// - Seeds are the new vertices, and the areas of their cells the masses. Between cells that touch the same
///   heat passes as through the fine edges between them under a constant gradient.
/// - Fine triangles of three cells become the new triangles, one per three cells and direction; only normals
///   need them.
/// Deterministic. O(n log n).
HeatLevel coarsen(const HeatLevel& fine, double radius, double rate_cap);

/// Whether the level is still the right one for heat that has flowed as far as sigma: up to 2.4 error_ratio
/// spacings the level is nearer to the truth than the next coarser one. Levels of few vertices carry
/// everything.
bool carries(const HeatLevel& level, double sigma, double error_ratio);
/// The radius to coarsen by, for a level whose first sigma is `sigma`.
double seed_radius(double sigma, double error_ratio);
/// The largest sigma of the state from which a level with this first sigma should start. Points that another
/// operator smoothed are rough at first under the level's operator; by `first_sigma` the roughness is gone.
double handover_sigma(double first_sigma);

}  // namespace texmesh
