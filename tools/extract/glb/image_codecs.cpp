#include "tools/extract/glb/image_codecs.h"

#include <webp/encode.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "format/base/errors.h"
#include "stages/image/png_writer.h"
#include "tools/extract/glb/jpeg_writer.h"

namespace texmesh {
namespace {

[[noreturn]] void fail(std::string expected, std::string found) {
  throw StageError("extract", "image", std::move(expected), std::move(found));
}

/// Where a step is rounded up. The same for all of them, many would change at one quality, and the bytes with
/// them by more than what a search may miss.
double rounding_of(std::size_t i) {
  if (i / DCTSIZE + i % DCTSIZE < 2) return 0.5;  // the three that show most
  const double spread = 0.618 * static_cast<double>(i);
  return 0.2 + 0.6 * (spread - std::floor(spread));
}

std::uint16_t step_of(double step, double quality, double rounding) {
  return static_cast<std::uint16_t>(
      std::clamp(std::floor(step * percent_of_steps(quality) / 100 + rounding), 1.0, 255.0));
}

void set_quality(jpeg_compress_struct& info, const ImageCoding& coding) {
  const double quality = std::clamp(coding.quality, 1.0, 100.0);
  jpeg_set_linear_quality(&info, 100, TRUE);
  for (JQUANT_TBL* table : info.quant_tbl_ptrs)
    for (std::size_t i = 0; table && i < DCTSIZE2; ++i)
      table->quantval[i] =
          coding.full_chroma ? texture_step(i, quality) : step_of(table->quantval[i], quality, 0.5);
}

void set_up_jpeg(jpeg_compress_struct& info, const Pixels& pixels, const ImageCoding& coding) {
  info.image_width = pixels.width_px;
  info.image_height = pixels.height_px;
  info.input_components = static_cast<int>(pixels.channels);
  info.in_color_space = pixels.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&info);
  if (coding.data && pixels.channels == 3) jpeg_set_colorspace(&info, JCS_RGB);
  set_quality(info, coding);
  if (coding.full_chroma) info.comp_info[0].h_samp_factor = info.comp_info[0].v_samp_factor = 1;
  info.dct_method = JDCT_ISLOW;
  info.optimize_coding = TRUE;
  jpeg_simple_progression(&info);
}

std::vector<std::uint8_t> encode_jpeg_file(const Pixels& pixels, const ImageCoding& coding) {
  if (pixels.channels != 1 && pixels.channels != 3)
    fail("1 or 3 channels for a JPEG", std::to_string(pixels.channels));
  const std::size_t stride = std::size_t{pixels.width_px} * pixels.channels;
  JpegWriter writer;
  jpeg_compress_struct& info = writer.info;
  const bool ok = jpeg_guarded(writer.errors, [&] {
    jpeg_mem_dest(&info, &writer.data, &writer.size);
    set_up_jpeg(info, pixels, coding);
    jpeg_start_compress(&info, TRUE);
    while (info.next_scanline < info.image_height) {
      auto* row = const_cast<JSAMPLE*>(pixels.data.data() + stride * info.next_scanline);  // read only
      jpeg_write_scanlines(&info, &row, 1);
    }
    jpeg_finish_compress(&info);
  });
  if (!ok) fail("an image that JPEG can hold", writer.errors.message);
  return writer.file();
}

struct WebpWriter {
  WebPPicture picture{};
  WebPMemoryWriter memory{};
  WebpWriter() {
    if (!WebPPictureInit(&picture)) fail("libwebp of the version compiled with", "another");
    WebPMemoryWriterInit(&memory);
  }
  ~WebpWriter() {
    WebPPictureFree(&picture);
    WebPMemoryWriterClear(&memory);
  }
  WebpWriter(const WebpWriter&) = delete;
  WebpWriter& operator=(const WebpWriter&) = delete;
};

bool import_pixels(WebPPicture& picture, const Pixels& pixels) {
  const int stride = static_cast<int>(pixels.width_px * pixels.channels);
  if (pixels.channels == 3) return WebPPictureImportRGB(&picture, pixels.data.data(), stride) != 0;
  if (pixels.channels == 4) return WebPPictureImportRGBA(&picture, pixels.data.data(), stride) != 0;
  std::vector<std::uint8_t> grey;
  grey.reserve(pixels.data.size() * 3);
  for (const std::uint8_t v : pixels.data) grey.insert(grey.end(), 3, v);
  return WebPPictureImportRGB(&picture, grey.data(), stride * 3) != 0;
}

std::vector<std::uint8_t> encode_webp_file(const Pixels& pixels, const ImageCoding& coding) {
  if (pixels.width_px > WEBP_MAX_DIMENSION || pixels.height_px > WEBP_MAX_DIMENSION)
    fail("at most 16383 px a side for a WebP",
         std::to_string(pixels.width_px) + " x " + std::to_string(pixels.height_px));
  WebPConfig config;
  if (!WebPConfigInit(&config)) fail("libwebp of the version compiled with", "another");
  config.method = coding.quick ? 3 : 6;
  config.quality = static_cast<float>(std::clamp(coding.quality, 0.0, 100.0));
  config.alpha_quality = 90;
  config.use_sharp_yuv = 1;
  config.thread_level = 0;
  WebpWriter writer;
  writer.picture.width = static_cast<int>(pixels.width_px);
  writer.picture.height = static_cast<int>(pixels.height_px);
  if (!import_pixels(writer.picture, pixels)) fail("memory for an image", "none");
  writer.picture.writer = WebPMemoryWrite;
  writer.picture.custom_ptr = &writer.memory;
  if (!WebPEncode(&config, &writer.picture))
    fail("an image that libwebp can code", "error " + std::to_string(writer.picture.error_code));
  return {writer.memory.mem, writer.memory.mem + writer.memory.size};
}

}  // namespace

double percent_of_steps(double quality) { return quality < 50 ? 5000 / quality : 200 - 2 * quality; }

std::uint16_t texture_step(std::size_t i, double quality) {
  const std::size_t row = i / DCTSIZE, column = i % DCTSIZE;
  return step_of(4 * (1 + static_cast<double>(row * row + column * column)), quality, rounding_of(i));
}

const char* mime_type_of(FileImage format) {
  if (format == FileImage::kWebp) return "image/webp";
  return format == FileImage::kPng ? "image/png" : "image/jpeg";
}

std::vector<std::uint8_t> encode_image(const Pixels& pixels, const ImageCoding& coding) {
  if (pixels.width_px == 0 || pixels.height_px == 0 ||
      pixels.data.size() != std::size_t{pixels.width_px} * pixels.height_px * pixels.channels)
    fail("pixels as many as width and height say", std::to_string(pixels.data.size()));
  if (coding.format == FileImage::kPng) return write_png(pixels);
  return coding.format == FileImage::kWebp ? encode_webp_file(pixels, coding)
                                           : encode_jpeg_file(pixels, coding);
}

}  // namespace texmesh
