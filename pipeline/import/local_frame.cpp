#include "pipeline/import/local_frame.h"
#include "format/base/box.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace texmesh {
namespace {

bool usable(const Vec3d& p, double largest) {
  auto in_range = [largest](double x) { return std::fabs(x) <= largest; };  // false for NaN
  return in_range(p.x) && in_range(p.y) && in_range(p.z);
}

// GCC 12.2 at -O2 drops the rounding of to_double(to_float(v)) when it puts x and y into one vector register
// (found by the test; -fno-tree-slp-vectorize does not), hence volatile.
double float_exact(double x) {
  const volatile float rounded = static_cast<float>(x);
  return static_cast<double>(rounded);
}

Vec3d choose_origin(const std::vector<Vec3d>& positions, double largest) {
  Box3d box;
  for (const Vec3d& p : positions)
    if (usable(p, largest)) box.extend(p);
  if (box.empty()) return {};
  double farthest = 0;
  for (int i = 0; i < 3; ++i) farthest = std::max({farthest, std::fabs(box.min[i]), std::fabs(box.max[i])});
  const double rounding = farthest / 16777216;  // half a unit in the last place of a float, at most
  if (rounding <= 1e-7 * box.diagonal()) return {};
  const Vec3d centre = box.centre();
  return {float_exact(centre.x), float_exact(centre.y), float_exact(centre.z)};
}

}  // namespace

void set_positions(Mesh& mesh, const std::vector<Vec3d>& positions, double largest) {
  mesh.origin = choose_origin(positions, largest);
  mesh.positions.resize(positions.size());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t i = 0; i < positions.size(); ++i)
    mesh.positions[i] =
        usable(positions[i], largest) ? to_float(positions[i] - mesh.origin) : Vec3f{nan, nan, nan};
}

}  // namespace texmesh
