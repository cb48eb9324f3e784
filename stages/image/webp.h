#pragma once
// WebP by libwebp itself, both ways: OpenImageIO 2.4 multiplies alpha into the colours whatever it is asked.

#include "stages/image/decode_image.h"
#include "stages/image/pixel_window.h"

namespace texmesh {

/// `name` is for messages. InputError for a damaged header and for an animation.
ImageHeader read_webp_header(const std::string& name, ByteSpan bytes);

/// All samples, interleaved; alpha is not multiplied in. InputError when the file is damaged or truncated,
/// and when its header is not the one that `image` was made from.
Bytes decode_webp_samples(const Image& image);

/// A lossy picture without alpha, as packages hold them, of at most `max_pixels`. FormatError for every other
/// file, and for bytes behind its end.
Pixels decode_lossy_webp(ByteSpan file, std::uint64_t max_pixels);

/// Of a file of append_webp() or encode_webp() alone: always four channels. StageError for another.
Pixels decode_webp_rgba(ByteSpan file);

struct WebpOptions {
  float quality = 75;       // 0..100
  int alpha_quality = 100;  // 100: without loss
  int method = 4;           // 0 is quick, 6 makes the smallest files: twice the time of 4 for 1 % fewer bytes
  bool as_large_as_jpeg = false;  // a quality takes about the bytes that it takes in a JPEG
  bool sharp_chroma = false;      // takes longer; colours keep their edges
};

/// Appends a lossy WebP of an image of 3 or 4 channels; with 3, coverage plays no part. Same bytes for same
/// input. StageError for sides above 16,383 px and where libwebp refuses.
void append_webp(const PixelWindow& image, std::uint32_t channels, const WebpOptions& options, Bytes& out);
/// The same of a whole image, of 1 channel, too, which becomes RGB.
Bytes encode_webp(const Pixels& pixels, const WebpOptions& options);

}  // namespace texmesh
