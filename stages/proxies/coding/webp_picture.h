#pragma once
// Inside the room only.
#include "format/base/bytes.h"
#include "stages/data/pixels.h"

namespace texmesh::proxies {

/// A lossy WebP file of three or four channels, sides at most 16,383 px; quality 0..100. StageError when
/// libwebp refuses.
Bytes encode_webp(const Pixels& pixels, int quality);

/// The reverse, for files of encode_webp() alone; always four channels.
Pixels decode_webp_picture(const Bytes& file);

}  // namespace texmesh::proxies
