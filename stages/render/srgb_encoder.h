#pragma once
// Inside the room only.
#include <array>
#include <cstddef>
#include <cstdint>

#include "format/base/srgb.h"
#include "stages/render/render_math.h"

namespace texmesh::render {

/// Light as the nearest sRGB code of 8 bits; what lies beyond 0..1 is cut off.
class SrgbEncoder {
 public:
  SrgbEncoder() {
    std::size_t code = 0;
    for (std::size_t i = 0; i <= kSteps; ++i) {
      while (code < 255 && static_cast<double>(i) / kSteps >= border(code)) ++code;
      first_[i] = static_cast<std::uint8_t>(code);
    }
    for (std::size_t c = 0; c < 255; ++c) border_[c] = static_cast<float>(border(c));
    border_[255] = 2;  // above all light
  }
  std::uint8_t operator()(float light) const {
    const float within = clamped(light, 0, 1);
    std::uint8_t code = first_[static_cast<std::size_t>(within * kSteps)];
    while (within >= border_[code]) ++code;
    return code;
  }

 private:
  static constexpr std::size_t kSteps = 4096;  // below the steepest steps of two codes
  /// Light between the codes c and c + 1.
  static double border(std::size_t c) { return light_of_srgb((static_cast<double>(c) + 0.5) / 255); }
  std::array<std::uint8_t, kSteps + 1> first_{};
  std::array<float, 256> border_{};
};

/// One for all; the same on every machine.
inline const SrgbEncoder& srgb_encoder() {
  static const SrgbEncoder encoder;
  return encoder;
}

}  // namespace texmesh::render
