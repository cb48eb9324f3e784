#include "tools/extract/budget/image_coder.h"

#include <algorithm>
#include <cmath>

#include "format/base/portable_math.h"
#include "stages/image/decode_image.h"

namespace texmesh {

double size_step(int step) {
  double share = 1;
  for (; step >= 2; step -= 2) share /= 2;
  return step == 1 ? share / std::sqrt(2.0) : share;
}

ImageCoder::ImageCoder(BudgetSource& source) : source_(source) {}

std::vector<TextureCoding> ImageCoder::codings(std::size_t image) const {
  const ExtractImages wanted = source_.request.images;
  const bool alpha = source_.image(image).alpha_plane.has_value();  // which no JPEG holds
  if (wanted == ExtractImages::kPng || (alpha && wanted == ExtractImages::kJpeg)) return {{FileImage::kPng}};
  if (wanted == ExtractImages::kWebp || alpha) return {{FileImage::kWebp}};
  std::vector<TextureCoding> out{{FileImage::kJpeg, true}};
  if (source_.image(image).colours) out.push_back({FileImage::kJpeg, false});
  if (wanted == ExtractImages::kAuto) out.push_back({FileImage::kWebp});
  return out;
}

std::optional<double> ImageCoder::stored_bytes(std::size_t image) const {
  const PackageImage& from = source_.image(image);
  const ExtractImages wanted = source_.request.images;
  const TextureInfo& info = source_.package.textures().at(from.plane);
  if (from.alpha_plane || !info.source_rung ||
      (wanted != ExtractImages::kAuto && wanted != ExtractImages::kJpeg))
    return std::nullopt;
  return static_cast<double>(info.rungs.back().bytes);
}

void ImageCoder::load_stored(std::size_t image) {
  if (stored_.contains(image)) return;
  const PackageImage& from = source_.image(image);
  const std::size_t last = source_.package.textures().at(from.plane).rungs.size() - 1;
  JoinedJpeg& joined =
      stored_.emplace(image, joined_plane(source_.package, from.plane, last, source_.context)).first->second;
  joined.fill_unseen(shown_texels(source_, image, joined.width_px(), joined.height_px()));
}

/// What makes up for averaging and for the interpolation of texels larger than pixels, as far as its bytes
/// allow: measured on lossless textures the best is .12 at half a texel per pixel, more with fewer.
float ImageCoder::sharpening(std::size_t image, double share) const {
  const double texels = std::max(source_.texels_per_pixel[image] * share * share, 1e-6);
  return static_cast<float>(std::clamp(0.06 - 0.05 * portable::log(texels) / portable::log(2), 0.0, 0.16));
}

Pixels ImageCoder::texels_of_share(std::size_t image, double share) {
  const PackageImage& from = source_.image(image);
  const double most = std::min(share, source_.textures.largest_share(image));
  const std::uint32_t width = side_of(from.width_px, most), height = side_of(from.height_px, most);
  std::vector<std::uint8_t> coverage;
  if (source_.request.images != ExtractImages::kPng) coverage = shown_texels(source_, image, width, height);
  return source_.textures.texels(image, width, height, coverage, sharpening(image, share));
}

const Pixels& ImageCoder::texels(std::size_t image, int step) {
  const auto [it, fresh] = by_step_.try_emplace({image, step});
  if (fresh) it->second = texels_of_share(image, size_step(step));
  return it->second;
}

FileImageData ImageCoder::encoded(std::size_t image, const Pixels& pixels, const TextureCoding& coding,
                                  double quality, bool quick) const {
  if (coding.stored) return {FileImage::kJpeg, stored_.at(image).file(quality)};
  return {coding.format, encode_image(pixels, {coding.format, quality, !source_.image(image).colours, quick,
                                               coding.full_chroma})};
}

OtherTextures ImageCoder::shown_by(std::size_t image, const FileImageData& file,
                                   const RunContext& context) const {
  OtherTextures out;
  for (std::size_t t = 0; t < source_.shown.size(); ++t)
    if (source_.shown[t].image == image)
      out[t] = render_texture(decode_image(probe_image("texture", file.bytes, {})), source_.shown[t].srgb, 0,
                              context);
  return out;
}

}  // namespace texmesh
