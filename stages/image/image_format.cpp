#include "stages/image/decode_image.h"

namespace texmesh {

const char* image_format_name(ImageFormat format) {
  constexpr const char* kNames[] = {"JPEG", "PNG", "TIFF", "WebP", "EXR"};
  return kNames[static_cast<std::size_t>(format)];
}

const char* image_extension(ImageFormat format) {
  constexpr const char* kExtensions[] = {"jpg", "png", "tif", "webp", "exr"};
  return kExtensions[static_cast<std::size_t>(format)];
}

std::optional<ImageFormat> sniff_image_format(ByteSpan bytes) {
  auto has = [bytes](std::size_t at, std::string_view magic) {
    return bytes.size() >= at + magic.size() && !std::memcmp(bytes.data() + at, magic.data(), magic.size());
  };
  using namespace std::string_view_literals;
  if (has(0, "\xff\xd8\xff"sv)) return ImageFormat::kJpeg;
  if (has(0, "\x89PNG\r\n\x1a\n"sv)) return ImageFormat::kPng;
  if (has(0, "II*\0"sv) || has(0, "MM\0*"sv) || has(0, "II+\0"sv) || has(0, "MM\0+"sv))
    return ImageFormat::kTiff;
  if (has(0, "RIFF"sv) && has(8, "WEBP"sv)) return ImageFormat::kWebp;
  if (has(0, "\x76\x2f\x31\x01"sv)) return ImageFormat::kExr;
  return std::nullopt;
}

void check_image_size(const std::string& name, std::uint64_t width, std::uint64_t height,
                      const ImageLimits& limits) {
  const std::string found = std::to_string(width) + " x " + std::to_string(height);
  if (width == 0 || height == 0) throw InputError(name, "image header", "at least 1 x 1 px", found);
  if (width > limits.max_side_px || height > limits.max_side_px)
    throw InputError(name, "image header", "sides up to " + std::to_string(limits.max_side_px) + " px",
                     found);
  if (width * height > limits.max_pixels)
    throw InputError(name, "image header", "up to " + std::to_string(limits.max_pixels) + " pixels", found);
}

}  // namespace texmesh
