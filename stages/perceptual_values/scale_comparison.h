#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/nested_scales.h"
#include "stages/geometry/distance.h"
#include "stages/geometry/scale_walk.h"

namespace texmesh {

/// A point on a scale.
struct ScalePoint {
  Vec3d at;
  double radius = 0;  // the skeleton distance there, which stands for the size of the shape around it
  std::uint32_t position = 0;  // the corner of its triangle that weighs most
};

/// Distances of the points of finer scales to one scale. Only the largest are asked for, so that few points
/// need a search: guesses bound the others. Safe to ask from many threads.
class ScaleComparison {
 public:
  /// `survivor`: of the scale, per position of S_0. The arguments must outlive the comparison.
  ScaleComparison(const Mesh& mesh, const NestedScale& scale, std::span<const std::uint32_t> survivor);

  /// The largest `count` distances, at most one for each point, falling; `relative`: over the point's radius.
  std::vector<double> largest(std::span<const ScalePoint> points, std::size_t count, bool relative) const;

 private:
  SurfaceDistance surface_;
  ScaleWalk walk_;
};

}  // namespace texmesh
