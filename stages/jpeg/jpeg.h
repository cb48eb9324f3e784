#pragma once
#include <span>

#include "stages/data/pixels.h"

namespace texmesh {

/// Decodes a complete Huffman-coded JPEG of 8 bits, 1 or 3 channels, baseline or progressive, with
/// libjpeg-turbo (ISLOW, fancy upsampling). Throws FormatError on any libjpeg error *or warning*, on bytes
/// after the end of the image, on more than 100 scans, and when the size exceeds max_pixels; nothing is
/// allocated for pixels before that check. For what packages hold; source images, which may be sloppy, go
/// through stages/image/decode_image.h.
Pixels decode_jpeg(std::span<const std::uint8_t> bytes, std::uint64_t max_pixels);

/// The same, but the luma (Y) channel only, which is cheaper than the colours; of a file whose channels are
/// not YCbCr, luma_of() of its pixels.
Pixels decode_jpeg_luma(std::span<const std::uint8_t> bytes, std::uint64_t max_pixels);

/// Luma as JPEG defines it (grey: the value), from 1 or 3 channels.
Pixels luma_of(const Pixels& pixels);

/// A complete baseline JFIF file with Huffman tables of its own; 1 or 3 channels, sides 1..65500. The
/// subsampling matters for 3 channels only. Throws StageError for what a JPEG cannot hold.
std::vector<std::uint8_t> encode_jpeg(const Pixels& pixels, int quality, Subsampling subsampling);

}  // namespace texmesh
