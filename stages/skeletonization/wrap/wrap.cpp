#include "stages/skeletonization/wrap/wrap.h"

#include <cstdint>
#include <numeric>

#include "format/base/no_index.h"
#include "stages/skeletonization/wrap/alpha_wrap.h"
#include "stages/skeletonization/wrap/decimation.h"

namespace texmesh {
namespace {

std::uint32_t root_of(std::vector<std::uint32_t>& parent, std::uint32_t p) {
  while (parent[p] != p) p = parent[p] = parent[parent[p]];
  return p;
}

/// Parts in the order of their first triangles, triangles in the order of the whole.
std::vector<TriangleSoup> split_parts(const TriangleSoup& wrap) {
  std::vector<std::uint32_t> parent(wrap.points.size());
  std::iota(parent.begin(), parent.end(), 0);
  for (const Triangle& t : wrap.triangles)
    for (std::size_t k = 1; k < 3; ++k) parent[root_of(parent, t[k])] = root_of(parent, t[0]);
  std::vector<TriangleSoup> parts;
  std::vector<std::uint32_t> part(wrap.points.size(), kNoIndex), number(wrap.points.size(), kNoIndex);
  for (const Triangle& t : wrap.triangles) {
    std::uint32_t& n = part[root_of(parent, t[0])];
    if (n == kNoIndex) {
      n = static_cast<std::uint32_t>(parts.size());
      parts.emplace_back();
    }
    TriangleSoup& to = parts[n];
    Triangle& triangle = to.triangles.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      if (number[t[k]] == kNoIndex) {
        number[t[k]] = static_cast<std::uint32_t>(to.points.size());
        to.points.push_back(wrap.points[t[k]]);
      }
      triangle[k] = number[t[k]];
    }
  }
  return parts;
}

}  // namespace

std::vector<TriangleSoup> wrap_surface(const TriangleSoup& soup, double alpha, double offset,
                                       std::size_t max_faces, std::size_t max_steps,
                                       const RunContext& context) {
  return split_parts(decimate(alpha_wrap(soup, alpha, offset, max_steps, context), max_faces));
}

}  // namespace texmesh
