#pragma once
// Inside the room only: four boxes that a line is tried against at once.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "format/base/box.h"

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace texmesh {

/// Four boxes in single precision, rounded as it comes: QuadLine makes up for it.
struct BoxQuad {
  static constexpr std::size_t kBoxes = 4;
  using Lanes = float __attribute__((vector_size(16)));
  std::array<Lanes, 3> low{}, high{};
  std::array<std::uint32_t, kBoxes> first{}, count{};  // count 0: `first` is another quad's index
  unsigned used = 0;                                   // a bit for each box that is set

  void set(std::size_t i, const Box3d& box, std::uint32_t first_at, std::uint32_t count_of) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k][i] = static_cast<float>(box.min[static_cast<int>(k)]);
      high[k][i] = static_cast<float>(box.max[static_cast<int>(k)]);
    }
    first[i] = first_at, count[i] = count_of;
    used |= 1u << i;
  }
};

/// A piece of a line to both sides of its origin. What it says of boxes errs to the side of meeting them, so
/// rounding never loses one.
class QuadLine {
 public:
  using Lanes = BoxQuad::Lanes;

  /// `direction` is unit; no coordinate of a box is larger than `largest`; no limit is above `reach`.
  QuadLine(Vec3d origin, Vec3d direction, double reach, double largest)
      : slack_(static_cast<float>(reach) * 1e-5f) {
    constexpr double kMostInverse = 1e15;
    for (int k = 0; k < 3; ++k) largest = std::max(largest, std::fabs(origin[k]));
    const double margin = largest * 1e-6;  // eight units in the last place of the largest number
    for (std::size_t k = 0; k < 3; ++k) {
      const int axis = static_cast<int>(k);
      from_low_[k] = Lanes{} + static_cast<float>(origin[axis] + margin);
      from_high_[k] = Lanes{} + static_cast<float>(origin[axis] - margin);
      inverse_[k] =
          Lanes{} + static_cast<float>(std::clamp(1 / direction[axis], -kMostInverse, kMostInverse));
    }
  }

  /// A bit for each box that the line may meet within `limit` to either side; at[i] is at most the least
  /// distance of box i.
  unsigned meets(const BoxQuad& quad, double limit, Lanes& at) const {
    const Lanes most = Lanes{} + (static_cast<float>(limit) + slack_);
    Lanes from = -most, to = most;
    for (std::size_t k = 0; k < 3; ++k) {
      const Lanes a = (quad.low[k] - from_low_[k]) * inverse_[k],
                  b = (quad.high[k] - from_high_[k]) * inverse_[k];
      const Lanes nearer = a < b ? a : b, farther = a < b ? b : a;
      from = from > nearer ? from : nearer;
      to = to < farther ? to : farther;
    }
    const Lanes ahead = from > -to ? from : -to;
    at = ahead - slack_;
    return bits(from <= to + 2 * slack_) & quad.used;
  }

 private:
  using Flags = decltype(Lanes{} < Lanes{});
  static unsigned bits(Flags flags) {
#ifdef __SSE2__
    return static_cast<unsigned>(_mm_movemask_ps(reinterpret_cast<__m128>(flags)));
#else
    unsigned out = 0;
    for (std::size_t i = 0; i < BoxQuad::kBoxes; ++i) out |= (static_cast<unsigned>(flags[i]) & 1u) << i;
    return out;
#endif
  }

  float slack_;
  std::array<Lanes, 3> from_low_, from_high_, inverse_;
};

}  // namespace texmesh
