#pragma once
#include <functional>
#include <span>

#include "stages/data/pixels.h"

namespace texmesh {

struct PngOptions {
  int level = 9;        // of deflate, 1 to 9
  bool linear = false;  // the values are light: chunk gAMA of 1
};

/// A PNG file (ISO/IEC 15948) of 1, 3 or 4 channels with 8 bits each: one filter per row by the least sum of
/// absolute differences, deflate, no ancillary chunks but gAMA, so the same pixels always give the same
/// bytes.
std::vector<std::uint8_t> write_png(const Pixels& pixels, const PngOptions& options = {});

// The PNG part of decode_image: libpng itself. OpenImageIO 2.4 does not say in which row a file is cut off,
// wants the whole image's memory before it looks at the pixels, and takes 0.15 s to load; here rows arrive
// one by one.

struct PngHeader {
  std::uint32_t width_px = 0, height_px = 0;
  std::uint32_t channels = 0;  // after decoding: palettes become RGB, transparent colours an alpha channel
  std::uint32_t bits = 0;      // 8 or 16; fewer become 8
  bool interlaced = false;
};

/// Throws InputError{name, ...} when the bytes before the pixels are no PNG's.
PngHeader read_png_header(const std::string& name, std::span<const std::uint8_t> bytes);

/// Calls row(samples) for every row, top first; 16-bit samples are in this machine's byte order. No colour
/// conversion: gamma and profiles are the caller's. Memory is taken for one row, and for the whole image when
/// it is interlaced. Throws InputError, with the row, when the data end early or are damaged.
void decode_png(const std::string& name, std::span<const std::uint8_t> bytes,
                const std::function<void(const std::uint8_t* samples)>& row);

}  // namespace texmesh
