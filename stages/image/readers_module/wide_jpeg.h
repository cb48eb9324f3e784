#pragma once
// Inside stages: JPEGs of 9 to 16 bits a sample, which libjpeg-turbo does not read.
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "stages/image/image_format.h"

namespace texmesh {

struct WideJpegHeader {
  std::uint32_t width_px = 0, height_px = 0;
  std::uint32_t channels = 0;  // 1 or 3, after decoding
  std::uint32_t bits = 0;      // of a sample: 9 to 16
};

/// Nothing for JPEGs of 8 bits and for what is no JPEG. `name` is for messages. InputError when it has other
/// numbers of components than 1 and 3.
std::optional<WideJpegHeader> read_wide_jpeg_header(const std::string& name, ByteSpan bytes);

/// Interleaved samples, 0..65535 whatever the file's bits, top row first; YCbCr becomes RGB. Memory for the
/// whole image is taken at once, if its bytes can hold it. InputError when the file is damaged, ends early,
/// or its header is not the one that `image` was made from.
std::vector<std::uint16_t> decode_wide_jpeg(const Image& image);

}  // namespace texmesh
