#pragma once
// AVIF by libavif, both ways: libaom codes, the decoder is the one that libavif was built with (dav1d).

#include <variant>

#include "stages/image/decode_image.h"

namespace texmesh {

/// Whether the first box is one of AVIF (ISO/IEC 23000-22).
bool is_avif(ByteSpan bytes);

struct AvifPicture {
  std::uint32_t width_px = 0, height_px = 0, channels = 0;  // 1, 2 (grey, alpha), 3 or 4
  std::variant<Bytes, std::vector<std::uint16_t>> samples;  // of 8 bits; of more, scaled to 16
  bool more_pictures = false;                               // a sequence, whose first is read
  bool profile = false;                                     // an ICC profile, which is left out
};

/// All samples as RGB, interleaved, top row first; alpha is not multiplied in. Size is checked against the
/// limits before memory is taken. InputError for damaged files, and for pictures that are to be cut, turned
/// or mirrored, since texture coordinates count stored pixels. Single-threaded.
AvifPicture decode_avif(const std::string& name, ByteSpan bytes, const ImageLimits& limits);

struct AvifOptions {
  double quality = 75;  // 0..100: about the 1 - SSIM of a JPEG of that quality
  bool data = false;    // numbers instead of colours: channels are coded as they are
  bool quick = false;   // libaom's speed 8 instead of 6: a third less time, a sixth more bytes
};

/// A lossy AVIF, 4:4:4, of an image of 1, 3 or 4 channels; alpha is coded nearly without loss. libaom tunes
/// for SSIM and works on one thread, so that the same input gives the same bytes. StageError where it
/// refuses.
Bytes encode_avif(const Pixels& pixels, const AvifOptions& options);

/// "0.11.1 (libaom 3.6.0, dav1d 1.0.0)": versions that change bytes.
std::string avif_version();

}  // namespace texmesh
