#include "tools/extract/budget/file_looks.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "tools/extract/budget/quality_search.h"

namespace texmesh {
namespace {

std::size_t largest_loss(const Allocation& images) {
  const auto most = std::ranges::max_element(images.images, {}, &CodedImage::loss);
  return static_cast<std::size_t>(most - images.images.begin());
}

/// Images that take many bytes, but for one.
std::vector<std::size_t> largest_but(const Allocation& images, std::size_t but) {
  constexpr std::size_t kMost = 3;
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < images.images.size(); ++i)
    if (i != but) out.push_back(i);
  std::ranges::stable_sort(out, std::greater{}, [&](std::size_t i) { return images.images[i].bytes; });
  if (out.size() > kMost) out.resize(kMost);
  return out;
}

/// About as many bytes; `steps` below 0 are a larger texture, two of them twice the sides. Nothing where it
/// has no other size.
std::optional<Allocation> with_largest_loss_resized(Allocation images, int steps, const ImageCoder& coder) {
  constexpr double kQualitiesOfStep = 22;
  images.last = largest_loss(images);
  ImagePlan& plan = images.images[images.last].plan;
  const double share = plan.share * std::sqrt(steps < 0 ? 1 << -steps : 1.0 / (1 << steps));
  if (plan.coding.format == FileImage::kPng || share > 1.01) return std::nullopt;
  if (plan.coding.stored) plan.coding = coder.codings(images.last).front();
  plan.share = std::min(share, 1.0);
  plan.quality = std::clamp(plan.quality + kQualitiesOfStep * steps, kLowestQuality, kHighestQuality);
  return images;
}

}  // namespace

FoundFile FileLooks::file_of(const MeshKey& key, const Allocation& images) {
  return {key, images, filler_.fill(meshes_.at(key), images)};
}

bool FileLooks::replace_if_nearer(FoundFile found, FoundFile& best) {
  if (!filler_.fills(found.file)) return false;
  look_at(found);
  if (!(found.difference < best.difference)) return false;
  best = std::move(found);
  return true;
}

/// Each way is gone once: what the last texture gets depends on the others alone.
bool FileLooks::try_file(const MeshKey& key, const Allocation& images, FoundFile& best) {
  Way way{key, images.last, {}};
  for (const CodedImage& image : images.images) way.plans.push_back(image.plan);
  way.plans[images.last].quality = 0;
  if (std::ranges::find(ways_, way) != ways_.end()) return false;
  ways_.push_back(std::move(way));
  return replace_if_nearer(file_of(key, images), best);
}

bool FileLooks::try_other_sizes(FoundFile& best) {
  bool nearer = false;
  for (const int steps : {-1, 1, -2, 2, 3})
    while (const auto other = with_largest_loss_resized(best.images, steps, coder_)) {
      if (!try_file(best.key, *other, best)) break;
      nearer = true;
    }
  return nearer;
}

bool FileLooks::try_other_codings(FoundFile& best) {
  bool nearer = false;
  Allocation images = best.images;
  images.last = largest_loss(images);
  ImagePlan& plan = images.images[images.last].plan;
  if (plan.coding.stored) return false;
  for (const TextureCoding& coding : coder_.codings(images.last)) {
    if (coding == plan.coding) continue;
    Allocation other = images;
    other.images[images.last].plan.coding = coding;
    nearer |= try_file(best.key, other, best);
  }
  return nearer;
}

bool FileLooks::try_other_shares(const LossCurves& curves, FoundFile& best) {
  const std::size_t most = largest_loss(best.images);
  Allocation same = best.images;
  same.last = most;
  bool nearer = try_file(best.key, same, best);
  for (const std::size_t image : largest_but(best.images, most))
    for (const int step : {-1, 1})
      while (const CodedImage* other = curves.neighbour(image, best.images.images[image], step)) {
        Allocation images = best.images;
        images.images[image] = *other;
        images.last = most;
        if (!try_file(best.key, images, best)) break;
        nearer = true;
      }
  return nearer;
}

bool FileLooks::try_other_codings_of_mesh(FoundFile& best) {
  bool nearer = false;
  for (const int step : {1, -1})
    for (;;) {
      MeshKey key = best.key;
      key.coding += step;
      if (key.coding < 0 || key.coding >= kMeshCodings) break;
      if (!try_file(key, best.images, best)) break;
      nearer = true;
    }
  return nearer;
}

void FileLooks::try_other_files(const LossCurves& curves, FoundFile& best) {
  constexpr int kMostRounds = 3;
  if (best.images.images.empty()) return;
  bool nearer = true;
  for (int i = 0; i < kMostRounds && nearer; ++i) {
    nearer = try_other_sizes(best);
    nearer |= try_other_codings(best);
    nearer |= try_other_shares(curves, best);
    nearer |= try_other_codings_of_mesh(best);
  }
}

void FileLooks::try_smaller_than_stored(FoundFile& best) {
  if (best.images.images.empty()) return;
  const ImagePlan& plan = best.images.images[largest_loss(best.images)].plan;
  if (!plan.coding.stored || plan.is_source()) return;
  look_at(best);
  for (const int steps : {1, 2})
    if (const auto other = with_largest_loss_resized(best.images, steps, coder_))
      try_file(best.key, *other, best);
}

std::vector<double> FileLooks::differences_of(const MeshKey& key, const BudgetFile& file) {
  OtherTextures textures;
  for (std::size_t i = 0; i < source_.image_count(); ++i)
    textures.merge(coder_.shown_by(i, file.images.at(source_.image(i).image), source_.context));
  const LitViews views(meshes_.mesh(key), source_.cameras, source_.context);
  std::vector<OtherTextures> changes;
  changes.emplace_back();  // none: what the mesh alone costs
  changes.push_back(std::move(textures));
  return source_.whole_pictures().differences(views, source_.best_textures, std::move(changes),
                                              source_.context);
}

}  // namespace texmesh
