#include "stages/proxies/coding/webp_picture.h"

#include <webp/decode.h>
#include <webp/encode.h>

#include <string>

#include "format/base/errors.h"

namespace texmesh::proxies {
namespace {

constexpr int kMethod = 4;

}  // namespace

Bytes encode_webp(const Pixels& pixels, int quality) {
  WebPConfig config;
  WebPPicture picture;
  if (!WebPConfigInit(&config) || !WebPPictureInit(&picture))
    throw StageError("proxies", "libwebp", "the version compiled with", "another");
  config.quality = static_cast<float>(quality);
  config.alpha_quality = quality;
  config.thread_level = 0;
  config.method = kMethod;
  picture.width = static_cast<int>(pixels.width_px);
  picture.height = static_cast<int>(pixels.height_px);
  WebPMemoryWriter memory;
  WebPMemoryWriterInit(&memory);
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &memory;
  const auto import = pixels.channels == 4 ? WebPPictureImportRGBA : WebPPictureImportRGB;
  const auto stride = static_cast<int>(pixels.width_px * pixels.channels);
  const bool coded = import(&picture, pixels.data.data(), stride) != 0 && WebPEncode(&config, &picture) != 0;
  const int error = picture.error_code;
  WebPPictureFree(&picture);
  Bytes out;
  if (coded) out.assign(memory.mem, memory.mem + memory.size);
  WebPMemoryWriterClear(&memory);
  if (!coded)
    throw StageError("proxies", "WebP", "a picture that libwebp can code", "error " + std::to_string(error));
  return out;
}

Pixels decode_webp_picture(const Bytes& file) {
  int width = 0, height = 0;
  if (!WebPGetInfo(file.data(), file.size(), &width, &height))
    throw StageError("proxies", "WebP", "a file", std::to_string(file.size()) + " bytes");
  Pixels out{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), 4, {}};
  out.data.resize(std::size_t{4} * out.width_px * out.height_px);
  if (!WebPDecodeRGBAInto(file.data(), file.size(), out.data.data(), out.data.size(), width * 4))
    throw StageError("proxies", "WebP", "a file that decodes", "another");
  return out;
}

}  // namespace texmesh::proxies
