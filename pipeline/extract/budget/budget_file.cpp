#include "pipeline/extract/budget/budget_file.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pipeline/extract/budget/quality_search.h"

namespace texmesh {
namespace {

constexpr double kLeastShare = 0.98;  // of the bytes asked for
constexpr double kNear = 0.99;        // where the search for a quality may stop
constexpr double kNormalQuality = 75, kDataQuality = 60;
constexpr double kNormalShare = 0.12, kDataShare = 0.05, kMostDataShare = 0.25;  // of all textures
constexpr double kMostTexelsPerByte = 40;                                        // nothing is coded in less
constexpr int kDataSteps = 120;  // of sizes, each 0.84 of the one before
constexpr std::uint32_t kTiny = 4;

double weight_of(const PackageImage& image) { return image.role == "normal" ? kNormalShare : kDataShare; }

double data_share(const BudgetSource& source) {
  if (source.colours.empty()) return 1;
  double share = 0;
  for (const std::size_t i : source.data) share += weight_of(source.image(i));
  return std::min(share, kMostDataShare);
}

double bytes_left(const BudgetSource& source, const MeshCandidate& mesh) {
  return static_cast<double>(source.request.bytes) - static_cast<double>(mesh.fixed_bytes);
}

}  // namespace

double colour_bytes(const BudgetSource& source, const MeshCandidate& mesh) {
  return source.colours.empty() ? 0 : bytes_left(source, mesh) * (1 - data_share(source));
}

bool BudgetFiller::fills(const BudgetFile& file) const {
  return fits(file) &&
         static_cast<double>(file.glb.size()) >= kLeastShare * static_cast<double>(source_.request.bytes);
}

void BudgetFiller::add(BudgetFile& file, std::size_t index, const Pixels& pixels, FileImageData data,
                       double quality) const {
  const PackageImage& image = source_.image(index);
  const double q = data.format == FileImage::kPng ? 100 : quality;
  file.rows.push_back(
      {image.image, image.role, data.format, pixels.width_px, pixels.height_px, q, data.bytes.size()});
  file.images[image.image] = std::move(data);
}

/// Textures of data at the largest size that their share allows.
void BudgetFiller::add_data(double bytes, BudgetFile& file) {
  double weights = 0;
  for (const std::size_t i : source_.data) weights += weight_of(source_.image(i));
  for (const std::size_t i : source_.data) {
    const PackageImage& image = source_.image(i);
    const double quality = image.role == "normal" ? kNormalQuality : kDataQuality;
    const double most = bytes * weight_of(image) / weights;
    for (int k = 0; k < kDataSteps; ++k) {
      const double share = size_step(k / 2) * (k % 2 ? std::sqrt(std::sqrt(0.5)) : 1.0);
      const bool last = side_of(std::max(image.width_px, image.height_px), share) <= kTiny;
      const double texels = static_cast<double>(image.width_px) * image.height_px * share * share;
      if (texels > kMostTexelsPerByte * most && !last) continue;
      const std::vector<Pixels> pixels = colours_.texels({i}, share);
      FileImageData data{colours_.format_for(pixels[0], colours_.format()), {}};
      data.bytes = encode_image(pixels[0], {data.format, quality, true, false, false});
      if (static_cast<double>(data.bytes.size()) > most && !last) continue;
      add(file, i, pixels[0], std::move(data), quality);
      break;
    }
  }
}

BudgetFile BudgetFiller::with_colours(const MeshCandidate& mesh, const BudgetFile& data,
                                      const std::vector<Pixels>& pixels, const ColourCoding& coding,
                                      double quality) const {
  BudgetFile file = data;
  std::vector<FileImageData> images = colours_.encoded(pixels, coding, quality, false);
  for (std::size_t k = 0; k < images.size(); ++k)
    add(file, source_.colours[k], pixels[k], std::move(images[k]), quality);
  std::sort(file.rows.begin(), file.rows.end(),
            [](const auto& a, const auto& b) { return a.image < b.image; });
  file.glb = mesh.file_with(file.images);
  return file;
}

void BudgetFiller::replace_if_larger(BudgetFile&& file, BudgetFile& best) const {
  if (fits(file) && (!fits(best) || file.glb.size() > best.glb.size())) best = std::move(file);
}

void BudgetFiller::by_quality(const MeshCandidate& mesh, const BudgetFile& data,
                              const std::vector<Pixels>& pixels, const ColourCoding& coding, double start,
                              int tries, BudgetFile& best, double& quality) {
  quality = quality_for(static_cast<double>(source_.request.bytes), start, kNear, tries, [&](double q) {
    BudgetFile file = with_colours(mesh, data, pixels, coding, q);
    const std::size_t bytes = file.glb.size();
    replace_if_larger(std::move(file), best);
    return bytes;
  });
}

void BudgetFiller::by_size(const MeshCandidate& mesh, const BudgetFile& data, const ColourCoding& coding,
                           double quality, double& share, BudgetFile& best) {
  double low = fits(best) ? share : 0, high = fits(best) ? 1 : share;
  for (int i = 0; i < 16 && !fills(best); ++i) {
    share = i == 0 && low > 0 ? 1 : (low + high) / 2;
    BudgetFile file = with_colours(mesh, data, colours_.texels(source_.colours, share), coding, quality);
    (fits(file) ? low : high) = share;
    const bool whole = share >= 1 && fits(file);
    replace_if_larger(std::move(file), best);
    if (whole) break;
  }
}

BudgetFile BudgetFiller::fill(const MeshCandidate& mesh, const TexturePoint& point) {
  const bool lossy = colours_.format() != FileImage::kPng;
  BudgetFile data;
  add_data(std::max(bytes_left(source_, mesh), 0.0) * data_share(source_), data);
  double share = size_step(point.step), quality = point.quality;
  const std::vector<Pixels> pixels = colours_.texels(source_.colours, share);
  BudgetFile best = with_colours(mesh, data, pixels, point.coding, kLowestQuality);
  if (!source_.colours.empty() && lossy)
    by_quality(mesh, data, pixels, point.coding, point.quality, 14, best, quality);
  if (fills(best) || source_.colours.empty()) return best;
  // The quality alone does not do it: its ends, or a lossless format, or a tiny image. Sizes do the rest.
  by_size(mesh, data, point.coding, quality, share, best);
  for (const ColourCoding& coding : colours_.codings())  // near the largest file another may reach further
    if (fits(best) && !fills(best) && lossy) {
      double end = kHighestQuality;
      by_quality(mesh, data, colours_.texels(source_.colours, share), coding, end, 8, best, end);
    }
  if (fits(best)) return best;
  BudgetFile least;
  add_data(0, least);
  return with_colours(mesh, least, colours_.texels(source_.colours, 0), {colours_.format(), false},
                      kLowestQuality);
}

}  // namespace texmesh
