#pragma once
// Inside proxies only: the flattening that keeps angles best.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "format/base/vec.h"
#include "format/model/model.h"
#include "stages/proxies/charts/flat_chart.h"

namespace texmesh {

/// Least-squares conformal map of a disk (Levy et al. 2002). `triangles`: indices of vertices, all of which
/// are in use; `own`: the same triangles in their own planes; two vertices far from each other are pinned at
/// `distance`. Returns a place per vertex; empty when the equations have no solution.
std::vector<Vec2d> conformal_map(std::span<const Triangle> triangles, std::span<const OwnPlane> own,
                                 std::size_t vertex_count, std::array<std::uint32_t, 2> pinned,
                                 double distance);

}  // namespace texmesh
