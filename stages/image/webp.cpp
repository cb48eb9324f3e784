#include "stages/image/webp.h"

#include <memory>

#include <webp/decode.h>
#include <webp/encode.h>

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

[[noreturn]] void refuse(const std::string& expected, const std::string& found) {
  throw FormatError("WebP", "", expected, found);
}

struct WebpPicture : WebPPicture {
  WebpPicture() {
    if (!WebPPictureInit(this))
      throw StageError("webp", "", "libwebp of the version compiled with", "another");
  }
  ~WebpPicture() { WebPPictureFree(this); }
  WebpPicture(const WebpPicture&) = delete;
  WebpPicture& operator=(const WebpPicture&) = delete;
};

WebPConfig config_of(const WebpOptions& options) {
  WebPConfig config;
  if (!WebPConfigInit(&config))
    throw StageError("webp", "", "libwebp of the version compiled with", "another");
  config.quality = options.quality;
  config.alpha_quality = options.alpha_quality;
  config.method = options.method;
  config.emulate_jpeg_size = options.as_large_as_jpeg ? 1 : 0;
  config.use_sharp_yuv = options.sharp_chroma ? 1 : 0;
  config.thread_level = 0;
  return config;
}

int append_to_bytes(const std::uint8_t* data, std::size_t size, const WebPPicture* picture) {
  auto& to = *static_cast<Bytes*>(picture->custom_ptr);
  try {
    to.insert(to.end(), data, data + size);
  } catch (const std::bad_alloc&) {  // must not cross libwebp's frames
    return 0;
  }
  return 1;
}

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

Pixels decode_lossy_webp(ByteSpan file, std::uint64_t max_pixels) {
  constexpr std::size_t kRiffHeader = 8;
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(file.data(), file.size(), &features) != VP8_STATUS_OK)
    refuse("a WebP file", "other bytes");
  // RIFF counts the bytes behind its own header, so a longer or shorter file shows here.
  const std::size_t stated =
      kRiffHeader + (file[4] | file[5] << 8 | file[6] << 16 | std::size_t{file[7]} << 24);
  if (stated != file.size())
    refuse(std::to_string(stated) + " bytes, as the header says", std::to_string(file.size()));
  if (features.has_alpha || features.has_animation || features.format != 1)
    refuse("a lossy picture without alpha", "another kind");
  Pixels out{static_cast<std::uint32_t>(features.width), static_cast<std::uint32_t>(features.height), 3, {}};
  const std::uint64_t pixels = std::uint64_t{out.width_px} * out.height_px;
  if (pixels > max_pixels)
    refuse("at most " + std::to_string(max_pixels) + " pixels",
           std::to_string(out.width_px) + " x " + std::to_string(out.height_px));
  out.data.resize(static_cast<std::size_t>(pixels) * 3);
  if (!WebPDecodeRGBInto(file.data(), file.size(), out.data.data(), out.data.size(),
                         static_cast<int>(out.width_px * 3)))
    refuse("an image that decodes", "damaged data");
  return out;
}

Pixels decode_webp_rgba(ByteSpan file) {
  int width = 0, height = 0;
  if (!WebPGetInfo(file.data(), file.size(), &width, &height))
    throw StageError("webp", "", "a file", std::to_string(file.size()) + " bytes");
  Pixels out{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), 4, {}};
  out.data.resize(std::size_t{4} * out.width_px * out.height_px);
  if (!WebPDecodeRGBAInto(file.data(), file.size(), out.data.data(), out.data.size(), width * 4))
    throw StageError("webp", "", "a file that decodes", "another");
  return out;
}

void append_webp(const PixelWindow& image, std::uint32_t channels, const WebpOptions& options, Bytes& out) {
  if (image.width_px > WEBP_MAX_DIMENSION || image.height_px > WEBP_MAX_DIMENSION)
    throw StageError("webp", "", "at most " + std::to_string(WEBP_MAX_DIMENSION) + " px a side for a WebP",
                     std::to_string(image.width_px) + " x " + std::to_string(image.height_px));
  WebpPicture picture;
  picture.width = static_cast<int>(image.width_px);
  picture.height = static_cast<int>(image.height_px);
  const auto import = channels == 4 ? WebPPictureImportRGBA : WebPPictureImportRGB;
  if (!import(&picture, image.data, static_cast<int>(image.stride_bytes)))
    throw StageError("webp", "", "memory for an image", "none");
  picture.writer = append_to_bytes;
  picture.custom_ptr = &out;
  const WebPConfig config = config_of(options);
  if (!WebPEncode(&config, &picture))
    throw StageError("webp", "", "an image that libwebp can code",
                     "error " + std::to_string(picture.error_code));
}

Bytes encode_webp(const Pixels& pixels, const WebpOptions& options) {
  const std::uint32_t channels = std::max(pixels.channels, 3u);
  Bytes grey, out;
  if (pixels.channels == 1) {
    grey.reserve(pixels.data.size() * 3);
    for (const std::uint8_t v : pixels.data) grey.insert(grey.end(), 3, v);
  }
  const std::uint8_t* data = grey.empty() ? pixels.data.data() : grey.data();
  append_webp({data, std::size_t{channels} * pixels.width_px, pixels.width_px, pixels.height_px}, channels,
              options, out);
  return out;
}

}  // namespace texmesh
