#pragma once
// Inside the room only.
#include <cstdint>

#include "format/base/srgb.h"

namespace texmesh {

/// Light as the nearest sRGB code of 8 bits, as exactly as with the formula, by a table; what lies beyond
/// 0..1 is cut off, NaN is 0. kLowerAtBorder: light in the very middle between two codes gets the lower one.
template <class Real, bool kLowerAtBorder>
class SrgbEncoder {
 public:
  SrgbEncoder() {
    for (std::size_t c = 0; c < 255; ++c)
      border_[c] = static_cast<Real>(light_of_srgb((static_cast<double>(c) + 0.5) / 255));
    border_[255] = 2;  // above all light
    std::uint8_t code = 0;
    for (std::size_t i = 0; i <= kSteps; ++i)
      first_[i] = code = code_from(code, static_cast<Real>(i) / kSteps);
  }
  std::uint8_t operator()(Real light) const {
    if (!(light > 0)) return 0;
    if (light >= 1) return 255;
    return code_from(first_[static_cast<std::size_t>(light * kSteps)], light);
  }

 private:
  static constexpr std::size_t kSteps = 4096;  // below the steepest steps of two codes
  std::uint8_t code_from(std::uint8_t code, Real light) const {
    while (kLowerAtBorder ? light > border_[code] : light >= border_[code]) ++code;
    return code;
  }
  std::array<Real, 256> border_{};  // between each code and the next
  std::array<std::uint8_t, kSteps + 1> first_{};
};

}  // namespace texmesh
