#include "stages/geometry/stand_in_scale.h"

namespace texmesh {

std::size_t stand_in_scale(const NestedScales& scales, std::size_t most_triangles, double farthest) {
  const std::vector<NestedScale>& all = scales.scales;
  std::size_t i = 0;
  while (i + 1 < all.size() && all[i].triangles.size() > most_triangles &&
         2 * all[i + 1].triangles.size() >= most_triangles && double{all[i + 1].error_rms} <= farthest)
    ++i;
  return i;
}

}  // namespace texmesh
