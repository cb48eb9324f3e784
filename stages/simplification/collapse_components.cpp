#include "stages/simplification/collapse_components.h"

#include <algorithm>
#include <numeric>

#include "format/base/box.h"

namespace texmesh {

CollapseComponents::CollapseComponents(const CollapseMesh& mesh, const ConditionedMesh& input)
    : begin(input.component_count + 1, 0),
      points(mesh.point_count()),
      size(input.component_count, 0),
      cost(input.component_count, 0) {
  auto component = [&](std::uint32_t p) { return input.component[mesh.members(p)[0]]; };
  std::vector<Box3d> box(count());
  for (std::uint32_t p = 0; p < mesh.point_count(); ++p) {
    const std::uint32_t c = component(p);
    ++begin[c + 1];
    box[c].extend(mesh.point(p));
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::uint32_t> at(begin.begin(), begin.end() - 1);
  for (std::uint32_t p = 0; p < mesh.point_count(); ++p) points[at[component(p)]++] = p;

  std::vector<double> area(count(), 0);
  for (const CollapseMesh::Face& face : mesh.faces()) {
    const Vec3d a = mesh.point(face.point[0]);
    area[component(face.point[0])] +=
        length(cross(mesh.point(face.point[1]) - a, mesh.point(face.point[2]) - a)) / 2;
  }
  for (std::size_t c = 0; c < count(); ++c) {
    size[c] = box[c].diagonal();
    // What moving the whole component by half its size would cost. Every area stands in the quadrics of three
    // corners, hence 3.
    cost[c] = 3 * area[c] * size[c] * size[c] / 4;
    if (area[c] > area[largest]) largest = static_cast<std::uint32_t>(c);
  }
}

}  // namespace texmesh
