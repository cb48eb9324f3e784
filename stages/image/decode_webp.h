#pragma once
// Inside stages: WebP by libwebp itself, because OpenImageIO 2.4 multiplies alpha into the colours whatever
// it is asked.
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "stages/image/image_format.h"

namespace texmesh {

/// `name` is for messages. InputError for a damaged header and for an animation.
ImageHeader read_webp_header(const std::string& name, ByteSpan bytes);

/// All samples, interleaved; alpha is not multiplied in. InputError when the file is damaged or truncated,
/// and when its header is not the one that `image` was made from.
Bytes decode_webp_samples(const Image& image);

}  // namespace texmesh
