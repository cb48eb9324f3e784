#include "stages/proxies/coding/webp_alpha.h"

#include <webp/encode.h>

#include <string>

#include "format/base/errors.h"

namespace texmesh::proxies {

Bytes encode_webp_alpha(const Pixels& rgba, int quality) {
  WebPConfig config;
  WebPPicture picture;
  if (!WebPConfigInit(&config) || !WebPPictureInit(&picture))
    throw StageError("proxies", "libwebp", "the version compiled with", "another");
  config.quality = static_cast<float>(quality);
  config.alpha_quality = quality;
  config.thread_level = 0;
  picture.width = static_cast<int>(rgba.width_px);
  picture.height = static_cast<int>(rgba.height_px);
  WebPMemoryWriter memory;
  WebPMemoryWriterInit(&memory);
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &memory;
  const bool coded = WebPPictureImportRGBA(&picture, rgba.data.data(), static_cast<int>(rgba.width_px * 4)) &&
                     WebPEncode(&config, &picture);
  const int error = picture.error_code;
  WebPPictureFree(&picture);
  Bytes out;
  if (coded) out.assign(memory.mem, memory.mem + memory.size);
  WebPMemoryWriterClear(&memory);
  if (!coded)
    throw StageError("proxies", "WebP", "a picture that libwebp can code", "error " + std::to_string(error));
  return out;
}

}  // namespace texmesh::proxies
