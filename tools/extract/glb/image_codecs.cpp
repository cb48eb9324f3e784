#include "tools/extract/glb/image_codecs.h"

#include "stages/image/png_writer.h"
#include "stages/image/webp.h"
#include "stages/jpeg/jpeg_coder.h"

namespace texmesh {
namespace {

std::vector<std::uint8_t> encode_jpeg_file(const Pixels& pixels, const ImageCoding& coding) {
  JpegKind kind;
  kind.channels = pixels.channels;
  kind.rgb = coding.data && pixels.channels == 3;
  kind.subsampling = coding.full_chroma ? Subsampling::k444 : Subsampling::k420;
  kind.file = FileSteps{coding.quality, coding.full_chroma};
  return JpegCoder(kind).complete({pixels.data.data(), std::size_t{pixels.width_px} * pixels.channels,
                                   pixels.width_px, pixels.height_px});
}

std::vector<std::uint8_t> encode_webp_file(const Pixels& pixels, const ImageCoding& coding) {
  WebpOptions options;
  options.method = coding.quick ? 3 : 6;
  options.quality = static_cast<float>(std::clamp(coding.quality, 0.0, 100.0));
  options.alpha_quality = 90;
  options.sharp_chroma = true;
  return encode_webp(pixels, options);
}

}  // namespace

const char* mime_type_of(FileImage format) {
  if (format == FileImage::kWebp) return "image/webp";
  return format == FileImage::kPng ? "image/png" : "image/jpeg";
}

std::vector<std::uint8_t> encode_image(const Pixels& pixels, const ImageCoding& coding) {
  if (pixels.width_px == 0 || pixels.height_px == 0 ||
      pixels.data.size() != std::size_t{pixels.width_px} * pixels.height_px * pixels.channels)
    throw StageError("extract", "image", "pixels as many as width and height say",
                     std::to_string(pixels.data.size()));
  if (coding.format == FileImage::kPng) return write_png(pixels);
  return coding.format == FileImage::kWebp ? encode_webp_file(pixels, coding)
                                           : encode_jpeg_file(pixels, coding);
}

}  // namespace texmesh
