#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "format/model/model.h"

namespace texmesh {

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

}  // namespace texmesh
