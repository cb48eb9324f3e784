#pragma once
#include <vector>

#include "format/base/box.h"

namespace texmesh {

/// The box of every connected component, by the components' numbers. `component`: per position.
inline std::vector<Box3f> component_boxes(const std::vector<std::uint32_t>& component,
                                          const std::vector<Vec3f>& positions) {
  std::vector<Box3f> boxes;
  for (std::size_t p = 0; p < component.size(); ++p) {
    if (component[p] >= boxes.size()) boxes.resize(component[p] + 1);
    boxes[component[p]].extend(positions[p]);
  }
  return boxes;
}

}  // namespace texmesh
