#pragma once
#include <optional>

#include "format/base/bytes.h"
#include "format/model/model.h"

namespace texmesh {

struct ImageLimits {
  std::uint32_t max_side_px = 65500;
  std::uint64_t max_pixels = 20000ull * 20000ull;
};

/// What the header of an image says.
struct ImageHeader {
  std::uint32_t width_px = 0, height_px = 0;
  std::uint8_t channels = 0, bits_per_channel = 0;
};

/// The allow-listed format that the first bytes show; nothing for any other content.
std::optional<ImageFormat> sniff_image_format(ByteSpan bytes);

/// "JPEG", "PNG", "TIFF", "WebP", "EXR".
const char* image_format_name(ImageFormat format);

/// "jpg", "png", "tif", "webp", "exr".
const char* image_extension(ImageFormat format);

/// InputError when the image is empty or larger than the limits. `name` is for the message.
void check_image_size(const std::string& name, std::uint64_t width_px, std::uint64_t height_px,
                      const ImageLimits& limits);

}  // namespace texmesh
