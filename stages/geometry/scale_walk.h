#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "format/base/no_index.h"
#include "stages/data/nested_scales.h"
#include "stages/geometry/distance.h"
#include "stages/geometry/spokes.h"

namespace texmesh {

/// Per position of S_0: the one that stands for it when the first `count` collapses are done. What has
/// collapsed into a component that vanished is stood for by the last position of it.
std::vector<std::uint32_t> survivors(std::size_t positions, std::span<const Collapse> collapses,
                                     std::size_t count);

/// Guesses where a scale is nearest to a point of a finer one: from what a corner near the point has become
/// on to nearer corners, and there among the triangles. Most guesses are right, and all bound the distance.
/// Safe to ask from many threads; the arguments must outlive it.
class ScaleWalk {
 public:
  ScaleWalk(const Mesh& mesh, const std::vector<Triangle>& triangles, std::span<const std::uint32_t> survivor,
            const SurfaceDistance& surface);

  struct Guess {
    double distance2 = 0;  // infinite where there is none: the corner has vanished with its component
    std::uint32_t triangle = kNoIndex;
    SurfaceDistance::Hint hint;  // that triangle, or nothing
  };
  Guess from(std::uint32_t position, Vec3d point) const;

 private:
  std::uint32_t nearest_corner(std::uint32_t from, Vec3d point) const;

  const std::vector<Vec3f>& positions_;
  std::span<const std::uint32_t> survivor_;
  const SurfaceDistance& surface_;
  Spokes spokes_;  // of positions
};

}  // namespace texmesh
