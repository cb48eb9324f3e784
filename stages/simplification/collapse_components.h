#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "stages/simplification/collapse_mesh.h"

namespace texmesh {

/// The connected components of the mesh, as things that can vanish whole.
struct CollapseComponents {
  std::vector<std::uint32_t> begin, points;  // points of component c: points[begin[c] .. begin[c + 1])
  std::vector<double> size;                  // diagonal of its bounding box, in the unit-diagonal frame
  std::vector<double> cost;                  // of letting it vanish, in the unit of the collapses' costs
  std::uint32_t largest = 0;                 // by area; the first of equals

  CollapseComponents(const CollapseMesh& mesh, const ConditionedMesh& input);
  std::size_t count() const { return size.size(); }
  std::span<const std::uint32_t> members(std::size_t c) const {
    return std::span(points).subspan(begin[c], begin[c + 1] - begin[c]);
  }
};

}  // namespace texmesh
