#include "stages/fragment_codec/rebuilt_z.h"

#include <algorithm>
#include <cmath>

namespace texmesh {
namespace {

/// Of 255ths.
int component(std::uint8_t byte) { return 2 * byte - 255; }

}  // namespace

void rebuild_z(Pixels& pixels) {
  if (pixels.channels != 3) return;
  for (std::size_t i = 0; i < pixels.data.size(); i += 3) {
    const int x = component(pixels.data[i]), y = component(pixels.data[i + 1]);
    const int rest = std::max(255 * 255 - x * x - y * y, 0);
    pixels.data[i + 2] = static_cast<std::uint8_t>((256 + static_cast<int>(std::sqrt(rest))) / 2);
  }
}

Pixels without_z(const PixelWindow& window) {
  Pixels out{window.width_px, window.height_px, 3, {}};
  out.data.reserve(std::size_t{3} * window.width_px * window.height_px);
  for (std::uint32_t y = 0; y < window.height_px; ++y) {
    const std::uint8_t* texel = window.data + y * window.stride_bytes;
    for (std::uint32_t x = 0; x < window.width_px; ++x, texel += 3) {
      double squares = 0;
      for (int c = 0; c < 3; ++c) squares += component(texel[c]) * component(texel[c]);
      const double scale = 127.5 / std::sqrt(squares);  // 255 is odd, so that no vector is 0
      for (int c = 0; c < 2; ++c)
        out.data.push_back(static_cast<std::uint8_t>(std::min(component(texel[c]) * scale + 128, 255.0)));
      out.data.push_back(128);
    }
  }
  return out;
}

}  // namespace texmesh
