#include "tools/extract/budget/filling.h"

#include <numeric>

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"

namespace texmesh {
namespace {

constexpr double kLeastShare = 0.98;  // of the bytes asked for
constexpr double kNear = 0.99;        // where the search for a quality may stop
constexpr double kNearest = 0.995;    // the same of a large file whose last image is quickly coded
constexpr std::uint64_t kLargeFile = 200000;
constexpr double kCheapTexels = 1.5e6;
constexpr double kFastNear = 0.9;
constexpr double kSampleNear = 0.995;
constexpr int kSampleTries = 6;
constexpr int kLearningTries = 3;
constexpr int kFastTries = 3;
constexpr double kLikelyPart = 0.7;  // of the package's bytes of a source: a file of it is worth a try
constexpr double kMiddle = 50;       // the level at which qualities stay

bool is_lossy(const ImagePlan& plan) { return plan.coding.format != FileImage::kPng; }

std::vector<std::size_t> all_of(std::size_t count) {
  std::vector<std::size_t> out(count);
  std::iota(out.begin(), out.end(), std::size_t{0});
  return out;
}

}  // namespace

double quality_for(double wanted, double start, double near, int tries,
                   const std::function<std::uint64_t(double)>& bytes, bool learns) {
  double grows = 30, last = 0, last_bytes = 0;  // bytes grow about as exp(quality / 30) in the middle
  double low = kLowestQuality, high = kHighestQuality, at = std::clamp(start, low, high);
  double low_bytes = 0, high_bytes = 0, best = kLowestQuality, best_bytes = 0;
  for (int i = 0; i < tries && high - low > 0.01; ++i) {
    const auto found = static_cast<double>(bytes(at));
    if (found <= wanted) {
      best = std::max(best, at);
      best_bytes = std::max(best_bytes, found);
      low = at, low_bytes = found;
      if (at >= kHighestQuality) break;
    } else {
      high = at, high_bytes = found;
      if (at <= kLowestQuality) break;
    }
    // JPEGs have whole quantisers: nearer to the bytes there often is no file, which eight tries would tell.
    const double enough = learns && i + 1 >= kLearningTries ? 2 * near - 1 : near;
    if (best_bytes >= enough * wanted) break;
    if (learns && last_bytes > 0 && found != last_bytes && found > 0)
      grows = std::clamp((at - last) / portable::log(found / last_bytes), 8.0, 90.0);
    last = at, last_bytes = found;
    double next = at + grows * portable::log(std::max(wanted, 1.0) * (1 + near) / 2 / std::max(found, 1.0));
    if (low_bytes > 0 && high_bytes > low_bytes)
      next = low + (high - low) * portable::log(wanted * (1 + near) / 2 / low_bytes) /
                       portable::log(high_bytes / low_bytes);
    // Never nearer to an end than a tenth of what is left, so that a bent curve does not stall the search.
    const double margin = (high - low) * 0.1;
    at = std::clamp(next, low_bytes > 0 ? low + margin : kLowestQuality,
                    high_bytes > 0 ? high - margin : kHighestQuality);
  }
  return best;
}

std::vector<std::uint8_t> MeshFile::with(const std::map<std::uint32_t, FileImageData>& images) const {
  StandaloneGlb out = *file;
  std::map<std::uint32_t, FileImageData> all;
  for (const std::uint32_t i : out.source_images()) all[i] = {FileImage::kWebp, {}};
  for (const auto& [i, data] : images) all[i] = data;
  out.set_images(all);
  return out.finish();
}

MeshFile Filling::mesh_file(const MeshCandidate& mesh) const {
  auto file = std::make_shared<StandaloneGlb>(*mesh.file);
  file->set_about(reserved_about(reference_.package.about(), reference_.place, bytes_));
  MeshFile out{std::move(file)};
  out.fixed_bytes = out.with({}).size();
  return out;
}

bool Filling::fills(const FilledFile& file) const {
  return fits(file) && static_cast<double>(file.glb.size()) >= kLeastShare * static_cast<double>(bytes_);
}

void Filling::replace_if_larger(FilledFile&& file, FilledFile& best) const {
  if (fits(file) && (!fits(best) || file.glb.size() > best.glb.size())) best = std::move(file);
}

void Filling::encode(Draft& draft, const std::vector<std::size_t>& images) const {
  draft.files.resize(draft.plans.size());
  draft.coded.resize(draft.plans.size());
  parallel_each(reference_.context, images.size(), 1, [&](std::size_t k) {
    const ImagePlan& plan = draft.plans[images[k]];
    FileImageData& file = draft.files[images[k]];
    if (!file.bytes.empty() && draft.coded[images[k]] == plan) return;
    file = candidates_.encoded(images[k], draft.pixels[images[k]], plan.coding, plan.quality,
                               reference_.wishes.fast());
    draft.coded[images[k]] = plan;
  });
}

Filling::Draft Filling::draft_of(const std::vector<ImagePlan>& plans) const {
  Draft draft;
  resize(draft, plans, 1);
  return draft;
}

/// Stored coefficients need no more than their sides.
void Filling::set_pixels(Draft& draft, std::size_t image) const {
  if (draft.plans[image].coding.stored) {
    candidates_.load_stored(image);
    draft.pixels[image] = {reference_.images[image].width_px, reference_.images[image].height_px, 0, {}};
  } else {
    draft.pixels[image] = candidates_.texels(image, draft.plans[image].share);
  }
}

/// The plans with sides so many times as long, at most whole.
void Filling::resize(Draft& draft, const std::vector<ImagePlan>& plans, double times) const {
  draft.plans = plans;
  draft.pixels.resize(plans.size());
  for (std::size_t i = 0; i < plans.size(); ++i) {
    ImagePlan& plan = draft.plans[i];
    plan.share = std::min(plans[i].share * times, 1.0);
    if (plan.coding.stored && plan.share < 1) plan.coding = candidates_.codings(i).front();
    set_pixels(draft, i);
  }
  encode(draft, all_of(plans.size()));
}

FilledFile Filling::file_of(const MeshFile& mesh, const Draft& draft) const {
  FilledFile file;
  for (std::size_t i = 0; i < draft.plans.size(); ++i) {
    const PackageImage& image = reference_.images[i];
    file.rows.push_back({image.image, image.role, draft.files[i].format, draft.pixels[i].width_px,
                         draft.pixels[i].height_px, is_lossy(draft.plans[i]) ? draft.plans[i].quality : 100,
                         draft.files[i].bytes.size()});
    file.images[image.image] = draft.files[i];
  }
  file.glb = mesh.with(file.images);
  file.has_sources = !draft.plans.empty() && std::ranges::all_of(draft.plans, &ImagePlan::is_source);
  return file;
}

void Filling::by_level(double start, double near, int tries,
                       const std::function<FilledFile(double level)>& at, FilledFile& best) const {
  const bool fast = reference_.wishes.fast();
  quality_for(
      static_cast<double>(bytes_), start, fast ? kFastNear : near, fast ? kFastTries : tries,
      [&](double level) {
        FilledFile file = at(level);
        const std::size_t bytes = file.glb.size();
        replace_if_larger(std::move(file), best);
        return bytes;
      },
      !reference_.wishes.best());
}

/// Bytes that are left go into the source's own coefficients, of the images first that lose most.
void Filling::by_source(const MeshFile& mesh, const DealtBytes& allocation, Draft& draft,
                        FilledFile& best) const {
  std::vector<std::size_t> images = all_of(draft.plans.size());
  std::stable_sort(images.begin(), images.end(), [&](std::size_t a, std::size_t b) {
    return allocation.images[a].loss > allocation.images[b].loss;
  });
  for (const std::size_t i : images) {
    const auto stored = candidates_.stored_bytes(i);
    const double others =
        static_cast<double>(best.glb.size()) - static_cast<double>(draft.files[i].bytes.size());
    // What nobody sees takes next to nothing in the file.
    if (!stored || draft.plans[i].is_source() || others + kLikelyPart * *stored > static_cast<double>(bytes_))
      continue;
    Draft other = draft;
    other.plans[i] = {{FileImage::kJpeg, false, true}, 1, kHighestQuality};
    set_pixels(other, i);
    encode(other, {i});
    FilledFile file = file_of(mesh, other);
    if (!fits(file)) continue;
    draft = std::move(other);
    best = std::move(file);
  }
}

/// The quality with which an image of a file is likely to fill the bytes: a sample of a large JPEG tells how
/// its bytes grow, as whole ones take long to code.
double Filling::likely_quality(const Draft& draft, std::size_t image, const FilledFile& file) const {
  const ImagePlan& plan = draft.plans[image];
  const Pixels& pixels = draft.pixels[image];
  const auto now = static_cast<double>(draft.files[image].bytes.size());
  const double wanted =
      static_cast<double>(bytes_) * (1 + kNear) / 2 - static_cast<double>(file.glb.size()) + now;
  if (reference_.wishes.effort != ExtractEffort::kUsual || plan.coding.format != FileImage::kJpeg ||
      plan.coding.stored || !(draft.coded[image] == plan) || wanted <= 0 ||
      !TextureTiles::suits(pixels.width_px, pixels.height_px))
    return plan.quality;
  const TextureTiles tiles(pixels, {}, {}, 0, reference_.context);
  const auto bytes_at = [&](double quality) {
    return static_cast<std::uint64_t>(tiles.file_bytes(
        candidates_.encoded(image, tiles.sample(), plan.coding, quality, false).bytes.size()));
  };
  const double times = now / static_cast<double>(bytes_at(plan.quality));
  return quality_for(wanted / times, plan.quality, kSampleNear, kSampleTries, bytes_at, true);
}

/// The image that got the last bytes takes up what the prediction missed.
void Filling::by_last_image(const MeshFile& mesh, std::size_t last, Draft& draft, FilledFile& best) const {
  const ImagePlan& plan = draft.plans[last];
  if (!is_lossy(plan) || (plan.is_source() && fits(best))) return;  // larger there is nothing
  const double texels = static_cast<double>(draft.pixels[last].width_px) * draft.pixels[last].height_px;
  const bool cheap = reference_.wishes.effort == ExtractEffort::kUsual && !plan.coding.stored &&
                     bytes_ > kLargeFile && texels < kCheapTexels;
  by_level(
      likely_quality(draft, last, best), cheap ? kNearest : kNear, 10,
      [&](double quality) {
        draft.plans[last].quality = quality;
        encode(draft, {last});
        return file_of(mesh, draft);
      },
      best);
}

void Filling::by_all_qualities(const MeshFile& mesh, Draft& draft, FilledFile& best) const {
  const std::vector<ImagePlan> plans = draft.plans;
  by_level(
      kMiddle, kNear, 12,
      [&](double level) {
        for (std::size_t i = 0; i < plans.size(); ++i)
          draft.plans[i].quality =
              std::clamp(plans[i].quality + 2 * (level - kMiddle), kLowestQuality, kHighestQuality);
        encode(draft, all_of(plans.size()));
        return file_of(mesh, draft);
      },
      best);
}

void Filling::by_sizes(const MeshFile& mesh, Draft& draft, FilledFile& best) const {
  const std::vector<ImagePlan> plans = draft.plans;
  double least = 1;
  for (const ImagePlan& p : plans) least = std::min(least, p.share);
  double low = fits(best) ? 1 : 0, high = fits(best) ? 1 / std::max(least, 1e-6) : 1;
  const auto fills_nearly = [&] {
    return reference_.wishes.fast() && fits(best) &&
           static_cast<double>(best.glb.size()) >= kFastNear * static_cast<double>(bytes_);
  };
  for (int i = 0; i < 16 && !fills(best) && !fills_nearly(); ++i) {
    const double times = i == 0 && low > 0 ? high : (low + high) / 2;
    resize(draft, plans, times);
    FilledFile file = file_of(mesh, draft);
    const bool whole = i == 0 && low > 0 && fits(file);
    (fits(file) ? low : high) = times;
    replace_if_larger(std::move(file), best);
    if (whole) return;
  }
}

/// Near the largest file another coding may reach further.
void Filling::by_codings(const MeshFile& mesh, Draft& draft, FilledFile& best) const {
  for (std::size_t i = 0; i < draft.plans.size(); ++i)
    for (const TextureCoding& coding : candidates_.codings(i)) {
      if (fills(best) || !is_lossy(draft.plans[i]) || draft.plans[i].is_source()) break;
      draft.plans[i].coding = coding;
      draft.plans[i].quality = kHighestQuality;
      by_last_image(mesh, i, draft, best);
    }
}

FilledFile Filling::smallest(const MeshFile& mesh) const {
  std::vector<ImagePlan> plans;
  for (std::size_t i = 0; i < reference_.images.size(); ++i)
    plans.push_back({candidates_.codings(i).back(), 0, kLowestQuality});
  return file_of(mesh, draft_of(plans));
}

FilledFile Filling::fill(const MeshFile& mesh, const DealtBytes& allocation) const {
  std::vector<ImagePlan> plans;
  for (const CodedImage& image : allocation.images) plans.push_back(image.plan);
  Draft draft = draft_of(plans);
  FilledFile best = file_of(mesh, draft);
  if (plans.empty() || fills(best)) return best;
  if (fits(best)) by_source(mesh, allocation, draft, best);
  if (fills(best) || (fits(best) && best.has_sources)) return best;
  by_last_image(mesh, allocation.last, draft, best);
  if (fills(best) || (fits(best) && reference_.wishes.fast())) return best;
  by_all_qualities(mesh, draft, best);
  if (!fills(best)) by_sizes(mesh, draft, best);
  if (fits(best) && !fills(best)) by_codings(mesh, draft, best);
  return fits(best) ? best : smallest(mesh);
}

}  // namespace texmesh
