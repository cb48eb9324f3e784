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

/// The level of every vertex.
HeatLevel finest_level(std::vector<Vec3d> points, std::vector<std::uint32_t> corners, double spacing,
                       double rate_cap);

/// The next coarser level. Vertices become seeds in order, each unless one is within `radius` along the
/// edges; every vertex joins its nearest seed (Voronoi cells by Dijkstra). Seeds are the new vertices, areas
/// of the cells the masses; between cells that touch the same heat passes as through the fine edges between
/// them under a constant gradient. Fine triangles of three cells become the new triangles, one per three
/// cells and direction; only normals need them. Deterministic: ties go to the earlier seed. O(n log n).
HeatLevel coarsen(const HeatLevel& fine, double radius, double rate_cap);

/// Whether heat that has flowed as far as sigma is smooth enough for a level: up to 2.4 error_ratio spacings
/// of it the level below is nearer to the truth. Levels of few vertices carry everything.
bool carries(const HeatLevel& level, double sigma, double error_ratio);
/// Radius to coarsen by for a level whose first sigma this is.
double seed_radius(double sigma, double error_ratio);
/// Largest sigma of the state that a level whose first sigma this is should start from. What its operator
/// makes of points that another one smoothed is roughest at first and gone by then.
double handover_sigma(double first_sigma);

}  // namespace texmesh
