#include "pipeline/extract/budget/file_looks.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "pipeline/extract/budget/quality_search.h"

namespace texmesh {
namespace {

/// About as many bytes; `step` -1 is a larger texture. Nothing where it has no other size.
std::optional<Allocation> with_largest_loss_resized(Allocation images, int step) {
  constexpr double kQualitiesOfStep = 22;
  if (images.images.empty()) return std::nullopt;
  const auto most = std::ranges::max_element(images.images, {}, &CodedImage::loss);
  ImagePlan& plan = most->plan;
  const double share = plan.share * std::sqrt(step < 0 ? 2.0 : 0.5);
  if (plan.coding.stored || plan.coding.format == FileImage::kPng || share > 1.01) return std::nullopt;
  plan.share = std::min(share, 1.0);
  plan.quality = std::clamp(plan.quality + kQualitiesOfStep * step, kLowestQuality, kHighestQuality);
  images.last = static_cast<std::size_t>(most - images.images.begin());
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

void FileLooks::try_other_sizes(FoundFile& best) {
  for (const int step : {-1, 1})
    while (const auto other = with_largest_loss_resized(best.images, step))
      if (!replace_if_nearer(file_of(best.key, *other), best)) break;
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
