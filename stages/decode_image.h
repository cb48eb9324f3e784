#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "format/model.h"

namespace texmesh {

inline constexpr int kDecodeImageVersion = 1;

/// Decoded pixels, row-major, interleaved, top row first.
struct Pixels {
  std::uint32_t width_px = 0, height_px = 0, channels = 0;
  std::vector<std::uint8_t> data;
  const std::uint8_t* at(std::uint32_t x, std::uint32_t y) const {
    return data.data() + (static_cast<std::size_t>(y) * width_px + x) * channels;
  }
};

struct ImageLimits {
  std::uint32_t max_side_px = 65500;
  std::uint64_t max_pixels = 20000ull * 20000ull;
};

/// The allow-listed format that the first bytes show, nothing for any other content.
std::optional<ImageFormat> sniff_image_format(std::span<const std::uint8_t> bytes);

/// Reads the header with the reader of exactly that format (never by OpenImageIO's own content sniffing) and checks
/// size and channels against the limits before any pixel is read. `name` is for messages. Throws InputError.
Image probe_image(std::string name, std::vector<std::uint8_t> bytes, const ImageLimits& limits);

/// Decodes to 8 bits per channel (16-bit and float images are scaled and rounded; float is clamped to 0..1), with the
/// channel count of the file (1..4), top row first, no colour conversion, EXIF orientation ignored as glTF viewers do.
/// Throws InputError when the file is truncated or lies about its size.
Pixels decode_image(const Image& image);

}  // namespace texmesh
