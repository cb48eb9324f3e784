#include "pipeline/extract/budget/colour_textures.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "format/base/portable_math.h"
#include "pipeline/extract/budget/quality_search.h"
#include "stages/base/parallel.h"
#include "stages/data/coverage.h"

namespace texmesh {
namespace {

constexpr double kTypicalTexelsPerByte = 6;  // where the search begins
constexpr int kSizeSteps = 30;
constexpr double kNearEnough = 0.96;  // of the bytes, while candidates are compared
constexpr int kTries = 6;
constexpr double kNoTexture = 1e9;
constexpr double kLeastImageBytes = 150;  // of any image file
constexpr double kWorthClimbing = 1.1;    // times the best of another coding

std::vector<std::uint8_t> coverage_by(const Model& model, std::uint32_t image, std::uint32_t width,
                                      std::uint32_t height) {
  for (std::size_t k = 0; k < model.images.size(); ++k)
    if (model.images[k].name == image_name(image))
      return coverage_of(model.mesh, model.materials, static_cast<std::int32_t>(k), width, height);
  return std::vector<std::uint8_t>(coverage_size_bytes(width, height));
}

/// Texels of colours that S_0 shows, at full size, over the pixels that its whole surface has on the screen:
/// four times its mean outline, as if it were convex.
double texels_per_pixel(const BudgetSource& source) {
  constexpr std::uint32_t kSide = 256;
  double texels = 0;
  for (const std::size_t i : source.colours) {
    const PackageImage& image = source.image(i);
    double covered = 0;
    for (const std::uint8_t bits : coverage_by(source.source, image.image, kSide, kSide))
      covered += std::popcount(bits);
    texels += covered / (kSide * kSide) * image.width_px * image.height_px;
  }
  return texels / std::max(4 * source.covered_px, 1.0);
}

std::uint64_t total(const std::vector<FileImageData>& images) {
  std::uint64_t sum = 0;
  for (const FileImageData& i : images) sum += (i.bytes.size() + 3) / 4 * 4;
  return sum;
}

}  // namespace

double size_step(int step) {
  double share = 1;
  for (; step >= 2; step -= 2) share /= 2;
  return step == 1 ? share / std::sqrt(2.0) : share;
}

ColourTextures::ColourTextures(BudgetSource& source, const ExtractRequest& request) : source_(source) {
  format_ = request.images == ExtractImages::kJpeg  ? FileImage::kJpeg
            : request.images == ExtractImages::kPng ? FileImage::kPng
                                                    : FileImage::kWebp;
  if (request.images == ExtractImages::kAuto || format_ == FileImage::kJpeg)
    codings_ = {{FileImage::kJpeg, true}, {FileImage::kJpeg, false}};
  if (format_ != FileImage::kJpeg) codings_.push_back({format_, false});
  texels_per_pixel_ = texels_per_pixel(source);
}

/// What makes up for averaging and for the interpolation of texels larger than pixels, as far as its bytes
/// allow: measured on lossless textures the best is .12 at half a texel per pixel, more with fewer.
float ColourTextures::sharpening(double share) const {
  const double texels = std::max(texels_per_pixel_ * share * share, 1e-6);
  return static_cast<float>(std::clamp(0.06 - 0.05 * portable::log(texels) / portable::log(2), 0.0, 0.16));
}

TexturePoint ColourTextures::best_size(const MeshCandidate& mesh, double bytes, const TexturePoint* near) {
  return climb_sizes(mesh, bytes, near ? near->step : likely_step(bytes), codings_.front(), kNoTexture);
}

TexturePoint ColourTextures::best_of_other_codings(const MeshCandidate& mesh, double bytes,
                                                   const TexturePoint& near) {
  TexturePoint best = near;
  for (std::size_t k = 1; k < codings_.size(); ++k) {
    const TexturePoint found =
        climb_sizes(mesh, bytes, best.step, codings_[k], kWorthClimbing * best.difference);
    if (found.difference < best.difference) best = found;
  }
  return best;
}

TexturePoint ColourTextures::climb_sizes(const MeshCandidate& mesh, double bytes, int step,
                                         const ColourCoding& coding, double limit) {
  std::map<int, TexturePoint> tried;
  const auto at = [&](int s) -> const TexturePoint& {
    const auto [it, fresh] = tried.try_emplace(s);
    if (fresh) it->second = measure(mesh, bytes, s, coding);
    return it->second;
  };
  if (limit < kNoTexture && at(step).difference > limit) return at(step);
  while (step + 1 < kSizeSteps && bytes > kLeastImageBytes && at(step).difference >= kNoTexture) ++step;
  while (step > 0 && at(step - 1).difference < at(step).difference) --step;
  while (step + 1 < kSizeSteps && at(step + 1).difference < at(step).difference) ++step;
  return at(step);
}

TexturePoint ColourTextures::same_size(const MeshCandidate& mesh, double bytes, const TexturePoint& near) {
  return measure(mesh, bytes, near.step, near.coding);
}

int ColourTextures::likely_step(double bytes) const {
  double texels = 0;
  for (const std::size_t i : source_.colours)
    texels += static_cast<double>(source_.image(i).width_px) * source_.image(i).height_px;
  const double wanted = std::max(bytes, 1.0) * kTypicalTexelsPerByte;
  int step = 0;
  while (step + 1 < kSizeSteps && texels * size_step(step) * size_step(step) > wanted) ++step;
  return step;
}

std::vector<Pixels> ColourTextures::texels(const std::vector<std::size_t>& which, double share) {
  std::vector<Pixels> out;
  for (const std::size_t i : which) {
    const PackageImage& image = source_.image(i);
    const double most = std::min(share, source_.textures.largest_share(i));
    const std::uint32_t width = side_of(image.width_px, most), height = side_of(image.height_px, most);
    std::vector<std::uint8_t> coverage;
    if (format_ != FileImage::kPng) coverage = coverage_by(source_.source, image.image, width, height);
    out.push_back(source_.textures.texels(i, width, height, coverage, sharpening(share)));
  }
  return out;
}

const std::vector<Pixels>& ColourTextures::colours_at(int step) {
  const auto [it, fresh] = by_step_.try_emplace(step);
  if (fresh) it->second = texels(source_.colours, size_step(step));
  return it->second;
}

FileImage ColourTextures::format_for(const Pixels& pixels, FileImage wanted) const {
  if (wanted != FileImage::kJpeg || pixels.channels != 4) return wanted;
  return format_ == FileImage::kJpeg ? FileImage::kPng : format_;
}

std::vector<FileImageData> ColourTextures::encoded(const std::vector<Pixels>& pixels,
                                                   const ColourCoding& coding, double quality,
                                                   bool quick) const {
  std::vector<FileImageData> out(pixels.size());
  parallel_for(source_.context, pixels.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const FileImage format = format_for(pixels[k], coding.format);
      out[k] = {format, encode_image(pixels[k], {format, quality, false, quick, coding.full_chroma})};
    }
  });
  return out;
}

TexturePoint ColourTextures::measure(const MeshCandidate& mesh, double bytes, int step,
                                     const ColourCoding& coding) {
  const std::vector<Pixels>& pixels = colours_at(step);
  std::map<double, std::vector<FileImageData>> files;
  double& start = last_quality_[static_cast<int>(coding.format) * 2 + coding.full_chroma];
  TexturePoint point{step, coding, 0, kNoTexture};
  point.quality = quality_for(bytes, start > 0 ? start : 50, kNearEnough, kTries, [&](double q) {
    files[q] = encoded(pixels, coding, q, true);
    return total(files[q]);
  });
  if (!files.count(point.quality)) files[point.quality] = encoded(pixels, coding, point.quality, true);
  const std::vector<FileImageData>& chosen = files[point.quality];
  if (static_cast<double>(total(chosen)) > bytes) return point;
  start = point.quality;
  ImageTextures shown_textures;
  for (std::size_t k = 0; k < source_.colours.size(); ++k)
    shown_textures[image_name(source_.image(source_.colours[k]).image)] = decoded_texture(chosen[k].bytes);
  point.difference = source_.difference(*mesh.views, shown_textures);
  return point;
}

}  // namespace texmesh
