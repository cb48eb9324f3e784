#pragma once

#include "format/base/fields.h"

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

enum class Subsampling : std::uint8_t { k420, k444 };

template <>
struct EnumNames<Subsampling> {
  static constexpr std::array<std::string_view, 2> names{"420", "444"};
};

}  // namespace texmesh
