#pragma once
#include <cstdint>
#include <vector>

namespace texmesh {

/// Decoded pixels, row-major, interleaved, top row first.
struct Pixels {
  std::uint32_t width_px = 0, height_px = 0, channels = 0;
  std::vector<std::uint8_t> data;
  const std::uint8_t* at(std::uint32_t x, std::uint32_t y) const {
    return data.data() + (static_cast<std::size_t>(y) * width_px + x) * channels;
  }
};

/// As Pixels, with the values of the file: integers keep their value (0..255, 0..65535), and floats stay as
/// they are, NaN and infinities included.
struct FloatPixels {
  std::uint32_t width_px = 0, height_px = 0, channels = 0;
  std::vector<float> data;
};

}  // namespace texmesh
