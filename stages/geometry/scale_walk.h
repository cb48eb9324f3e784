#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "format/base/no_index.h"
#include "stages/data/nested_scales.h"
#include "stages/geometry/distance.h"

namespace texmesh {

/// Per position of S_0: the one that stands for it when the first `count` collapses are done. What has
/// collapsed into a component that vanished is stood for by the last position of it.
std::vector<std::uint32_t> survivors(std::size_t positions, std::span<const Collapse> collapses,
                                     std::size_t count);

/// The triangles at each place of a mesh.
class Spokes {
 public:
  /// A triangle at a place, and the place of its next corner.
  struct Spoke {
    std::uint32_t triangle, next;
  };
  /// `place_of` gives a wedge's place, below `places`. Triangles of a place keep their order.
  template <class PlaceOf>
  Spokes(std::size_t places, std::span<const Triangle> triangles, PlaceOf&& place_of)
      : begin_(places + 1, 0), spoke_(3 * triangles.size()) {
    for (const Triangle& t : triangles)
      for (const std::uint32_t w : t) ++begin_[place_of(w) + 1];
    for (std::size_t p = 1; p < begin_.size(); ++p) begin_[p] += begin_[p - 1];
    std::vector<std::uint32_t> end(begin_.begin(), begin_.end() - 1);
    for (std::uint32_t t = 0; t < triangles.size(); ++t)
      for (std::size_t k = 0; k < 3; ++k)
        spoke_[end[place_of(triangles[t][k])]++] = {t, place_of(triangles[t][(k + 1) % 3])};
  }
  std::span<const Spoke> at(std::uint32_t place) const {
    return {spoke_.data() + begin_[place], spoke_.data() + begin_[place + 1]};
  }

 private:
  std::vector<std::uint32_t> begin_;
  std::vector<Spoke> spoke_;
};

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
