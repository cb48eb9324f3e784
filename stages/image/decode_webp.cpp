#include "stages/image/decode_webp.h"

#include <memory>

#include <webp/decode.h>

#include "format/base/errors.h"

namespace texmesh {
namespace {

WebPBitstreamFeatures read_features(const std::string& name, ByteSpan bytes) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(bytes.data(), bytes.size(), &features) != VP8_STATUS_OK)
    throw InputError(name, "WebP header", "a readable one", "a damaged or truncated one");
  if (features.has_animation) throw InputError(name, "WebP header", "a still image", "an animation");
  return features;
}

/// Row by row into memory that is touched as far as there are rows.
void decode_rows(const Image& image, std::uint8_t* pixels, std::size_t size) {
  const std::unique_ptr<WebPIDecoder, void (*)(WebPIDecoder*)> decoder(
      WebPINewRGB(image.channels == 4 ? MODE_RGBA : MODE_RGB, pixels, size,
                  static_cast<int>(image.width_px * image.channels)),
      WebPIDelete);
  if (!decoder) throw InputError(image.name, "pixels", "memory for a WebP decoder", "none");
  const VP8StatusCode status = WebPIUpdate(decoder.get(), image.bytes.data(), image.bytes.size());
  if (status == VP8_STATUS_OK) return;
  int row = 0;
  if (!WebPIDecGetRGB(decoder.get(), &row, nullptr, nullptr, nullptr)) row = 0;
  throw InputError(image.name, "row " + std::to_string(row) + " of " + std::to_string(image.height_px),
                   "a whole WebP", status == VP8_STATUS_SUSPENDED ? "a truncated one" : "a damaged one");
}

/// A WebP of a picture with any noise is larger than this part of its pixels.
constexpr std::size_t kMostShrunk = 1000;

}  // namespace

ImageHeader read_webp_header(const std::string& name, ByteSpan bytes) {
  const WebPBitstreamFeatures features = read_features(name, bytes);
  return {static_cast<std::uint32_t>(features.width), static_cast<std::uint32_t>(features.height),
          static_cast<std::uint8_t>(features.has_alpha ? 4 : 3), 8};
}

Bytes decode_webp_samples(const Image& image) {
  const ImageHeader header = read_webp_header(image.name, image.bytes);
  if (header.width_px != image.width_px || header.height_px != image.height_px ||
      header.channels != image.channels)
    throw InputError(image.name, "WebP header", "the size that import had found", "another one");
  const std::size_t size = static_cast<std::size_t>(image.width_px) * image.height_px * image.channels;
  // So large a size is a lie, or one colour everywhere: only rows that are there may take memory.
  if (size / kMostShrunk > image.bytes.size()) {
    const auto untouched = std::make_unique_for_overwrite<std::uint8_t[]>(size);
    decode_rows(image, untouched.get(), size);
    return {untouched.get(), untouched.get() + size};
  }
  Bytes out(size);
  decode_rows(image, out.data(), size);
  return out;
}

}  // namespace texmesh
