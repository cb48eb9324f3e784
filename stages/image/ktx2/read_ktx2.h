#pragma once

#include "stages/image/decode_image.h"

namespace texmesh {

/// Whether the first bytes are those of a Khronos KTX 2.0 file.
bool is_ktx2(ByteSpan bytes);

struct Ktx2Picture {
  Pixels pixels;             // 1 (grey), 3 (RGB) or 4 (RGBA) channels, top row first
  bool linear = false;       // colours are light: the file says so, and its format is no SRGB one
  std::uint32_t levels = 1;  // of which the first, the largest, is read
};

/// The largest level of a 2D texture with texels R8, RG8, RGB8 or RGBA8, UNORM or SRGB, plain or packed with
/// Zstandard. Missing channels are 0, missing alpha is 1, as KTX says; but a file of one channel is grey. The
/// file's KTXswizzle goes before both, KTXorientation "ru" is turned to top row first. All ranges and sizes
/// are checked before memory is taken. `name` is for messages. InputError for damaged files and for every
/// other kind: Basis Universal, blocks of a GPU, ZLIB, volumes, arrays, cubes, alpha that is multiplied in.
Ktx2Picture read_ktx2(const std::string& name, ByteSpan bytes, const ImageLimits& limits);

/// The same as a PNG, with gamma 1 for light: packages keep sources of a closed list of kinds (SPEC.md X03,
/// W06), of which KTX2 is none. Errors as read_ktx2.
Bytes png_of_ktx2(const std::string& name, ByteSpan bytes, const ImageLimits& limits);

}  // namespace texmesh
