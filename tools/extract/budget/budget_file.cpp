#include "tools/extract/budget/budget_file.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "stages/base/parallel.h"
#include "tools/extract/budget/quality_search.h"

namespace texmesh {
namespace {

constexpr double kLeastShare = 0.98;  // of the bytes asked for
constexpr double kNear = 0.99;        // where the search for a quality may stop
constexpr double kMiddle = 50;        // the level at which qualities stay

bool is_lossy(const ImagePlan& plan) { return plan.coding.format != FileImage::kPng; }

std::vector<std::size_t> all_of(std::size_t count) {
  std::vector<std::size_t> out(count);
  std::iota(out.begin(), out.end(), std::size_t{0});
  return out;
}

}  // namespace

bool BudgetFiller::fills(const BudgetFile& file) const {
  return fits(file) &&
         static_cast<double>(file.glb.size()) >= kLeastShare * static_cast<double>(source_.request.bytes);
}

void BudgetFiller::replace_if_larger(BudgetFile&& file, BudgetFile& best) const {
  if (fits(file) && (!fits(best) || file.glb.size() > best.glb.size())) best = std::move(file);
}

void BudgetFiller::encode(Draft& draft, const std::vector<std::size_t>& images) const {
  draft.files.resize(draft.plans.size());
  parallel_for(source_.context, images.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const ImagePlan& plan = draft.plans[images[k]];
      draft.files[images[k]] =
          coder_.encoded(images[k], draft.pixels[images[k]], plan.coding, plan.quality, false);
    }
  });
}

BudgetFiller::Draft BudgetFiller::draft_of(const std::vector<ImagePlan>& plans) {
  Draft draft;
  resize(draft, plans, 1);
  return draft;
}

/// Stored coefficients need no more than their sides.
void BudgetFiller::set_pixels(Draft& draft, std::size_t image) {
  if (draft.plans[image].coding.stored) {
    coder_.load_stored(image);
    draft.pixels[image] = {source_.image(image).width_px, source_.image(image).height_px, 0, {}};
  } else {
    draft.pixels[image] = coder_.texels_of_share(image, draft.plans[image].share);
  }
}

/// The plans with sides so many times as long, at most whole.
void BudgetFiller::resize(Draft& draft, const std::vector<ImagePlan>& plans, double times) {
  draft.plans = plans;
  draft.pixels.resize(plans.size());
  for (std::size_t i = 0; i < plans.size(); ++i) {
    ImagePlan& plan = draft.plans[i];
    plan.share = std::min(plans[i].share * times, 1.0);
    if (plan.coding.stored && plan.share < 1) plan.coding = coder_.codings(i).front();
    set_pixels(draft, i);
  }
  encode(draft, all_of(plans.size()));
}

BudgetFile BudgetFiller::file_of(const MeshCandidate& mesh, const Draft& draft) const {
  BudgetFile file;
  for (std::size_t i = 0; i < draft.plans.size(); ++i) {
    const PackageImage& image = source_.image(i);
    file.rows.push_back({image.image, image.role, draft.files[i].format, draft.pixels[i].width_px,
                         draft.pixels[i].height_px, is_lossy(draft.plans[i]) ? draft.plans[i].quality : 100,
                         draft.files[i].bytes.size()});
    file.images[image.image] = draft.files[i];
  }
  file.glb = mesh.file_with(file.images);
  file.has_sources = !draft.plans.empty() && std::ranges::all_of(draft.plans, &ImagePlan::is_source);
  return file;
}

void BudgetFiller::by_level(double start, int tries, const std::function<BudgetFile(double level)>& at,
                            BudgetFile& best) {
  quality_for(static_cast<double>(source_.request.bytes), start, kNear, tries, [&](double level) {
    BudgetFile file = at(level);
    const std::size_t bytes = file.glb.size();
    replace_if_larger(std::move(file), best);
    return bytes;
  });
}

/// Bytes that are left go into the source's own coefficients, of the images first that lose most.
void BudgetFiller::by_source(const MeshCandidate& mesh, const Allocation& allocation, Draft& draft,
                             BudgetFile& best) {
  std::vector<std::size_t> images = all_of(draft.plans.size());
  std::stable_sort(images.begin(), images.end(), [&](std::size_t a, std::size_t b) {
    return allocation.images[a].loss > allocation.images[b].loss;
  });
  for (const std::size_t i : images) {
    const auto stored = coder_.stored_bytes(i);
    const double others =
        static_cast<double>(best.glb.size()) - static_cast<double>(draft.files[i].bytes.size());
    // What nobody sees takes next to nothing in the file, so half of the package's bytes is a chance.
    if (!stored || draft.plans[i].is_source() ||
        others + 0.5 * *stored > static_cast<double>(source_.request.bytes))
      continue;
    Draft other = draft;
    other.plans[i] = {{FileImage::kJpeg, false, true}, 1, kHighestQuality};
    set_pixels(other, i);
    encode(other, {i});
    BudgetFile file = file_of(mesh, other);
    if (!fits(file)) continue;
    draft = std::move(other);
    best = std::move(file);
  }
}

/// The image that got the last bytes takes up what the prediction missed.
void BudgetFiller::by_last_image(const MeshCandidate& mesh, std::size_t last, Draft& draft,
                                 BudgetFile& best) {
  const ImagePlan& plan = draft.plans[last];
  if (!is_lossy(plan) || (plan.is_source() && fits(best))) return;  // larger there is nothing
  by_level(
      draft.plans[last].quality, 10,
      [&](double quality) {
        draft.plans[last].quality = quality;
        encode(draft, {last});
        return file_of(mesh, draft);
      },
      best);
}

void BudgetFiller::by_all_qualities(const MeshCandidate& mesh, Draft& draft, BudgetFile& best) {
  const std::vector<ImagePlan> plans = draft.plans;
  by_level(
      kMiddle, 12,
      [&](double level) {
        for (std::size_t i = 0; i < plans.size(); ++i)
          draft.plans[i].quality =
              std::clamp(plans[i].quality + 2 * (level - kMiddle), kLowestQuality, kHighestQuality);
        encode(draft, all_of(plans.size()));
        return file_of(mesh, draft);
      },
      best);
}

void BudgetFiller::by_sizes(const MeshCandidate& mesh, Draft& draft, BudgetFile& best) {
  const std::vector<ImagePlan> plans = draft.plans;
  double least = 1;
  for (const ImagePlan& p : plans) least = std::min(least, p.share);
  double low = fits(best) ? 1 : 0, high = fits(best) ? 1 / std::max(least, 1e-6) : 1;
  for (int i = 0; i < 16 && !fills(best); ++i) {
    const double times = i == 0 && low > 0 ? high : (low + high) / 2;
    resize(draft, plans, times);
    BudgetFile file = file_of(mesh, draft);
    const bool whole = i == 0 && low > 0 && fits(file);
    (fits(file) ? low : high) = times;
    replace_if_larger(std::move(file), best);
    if (whole) return;
  }
}

/// Near the largest file another coding may reach further.
void BudgetFiller::by_codings(const MeshCandidate& mesh, Draft& draft, BudgetFile& best) {
  for (std::size_t i = 0; i < draft.plans.size(); ++i)
    for (const TextureCoding& coding : coder_.codings(i)) {
      if (fills(best) || !is_lossy(draft.plans[i]) || draft.plans[i].is_source()) break;
      draft.plans[i].coding = coding;
      draft.plans[i].quality = kHighestQuality;
      by_last_image(mesh, i, draft, best);
    }
}

BudgetFile BudgetFiller::smallest(const MeshCandidate& mesh) {
  std::vector<ImagePlan> plans;
  for (std::size_t i = 0; i < source_.image_count(); ++i)
    plans.push_back({coder_.codings(i).back(), 0, kLowestQuality});
  return file_of(mesh, draft_of(plans));
}

BudgetFile BudgetFiller::fill(const MeshCandidate& mesh, const Allocation& allocation) {
  std::vector<ImagePlan> plans;
  for (const CodedImage& image : allocation.images) plans.push_back(image.plan);
  Draft draft = draft_of(plans);
  BudgetFile best = file_of(mesh, draft);
  if (plans.empty() || fills(best)) return best;
  if (fits(best)) by_source(mesh, allocation, draft, best);
  if (fills(best) || (fits(best) && best.has_sources)) return best;
  by_last_image(mesh, allocation.last, draft, best);
  if (fills(best)) return best;
  by_all_qualities(mesh, draft, best);
  if (!fills(best)) by_sizes(mesh, draft, best);
  if (fits(best) && !fills(best)) by_codings(mesh, draft, best);
  return fits(best) ? best : smallest(mesh);
}

}  // namespace texmesh
