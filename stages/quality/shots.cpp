#include "stages/quality/shots.h"

#include "stages/base/parallel.h"

namespace texmesh {

namespace {

bool ended(const Shot& shot, const Losses& so_far) {
  return shot.ends_beyond &&
         !std::ranges::all_of(so_far, [&](const Loss& l) { return shot.ends_beyond->hold(l); });
}

}  // namespace

std::size_t shown_scale(const std::vector<RenderScene>& scenes, std::size_t scale, double displayed_px) {
  constexpr std::size_t kLarge = 1'000'000;
  constexpr double kTrianglesPerPixel = 4;
  const double least = kTrianglesPerPixel * displayed_px * displayed_px;
  if (scenes[0].triangles->size() <= kLarge) return scale;
  while (scale + 1 < scenes.size() && static_cast<double>(scenes[scale + 1].triangles->size()) >= least)
    ++scale;
  return scale;
}

std::vector<SizePictures::ScaleShots> SizePictures::by_scale(const std::vector<Shot>& shots,
                                                             const std::vector<std::size_t>& taken) {
  std::vector<ScaleShots> out;
  for (const std::size_t i : taken) {
    auto found = std::ranges::find(out, shots[i].scale, &ScaleShots::scale);
    if (found == out.end()) found = out.insert(out.end(), {shots[i].scale, {}});
    found->shots.push_back(i);
  }
  return out;
}

/// One picture per list of materials.
PictureVariants SizePictures::pictures(std::size_t scale, const PictureView& at,
                                       const std::vector<const ShotMaterials*>& materials,
                                       const RunContext& context) {
  const std::size_t shown = shown_scale(studio_.scenes, scale, displayed_px_);
  RenderScene scene = studio_.scenes[shown];
  scene.materials = materials.front();
  scene.texture_count = studio_.textures.size();
  const auto shaded = [&](const Visibility& seen) {
    return shade_variants(scene, seen, materials, studio_.textures, studio_.environment, context);
  };
  const auto look_here = [&] {
    return look(scene, at.place.camera, at.place.side_px, context, at.bands.rendered);
  };
  if (shown > 0) return shaded(look_here());
  const auto [found, is_new] = finest_.try_emplace(at.view);
  if (is_new) found->second = look_here();
  return shaded(found->second);
}

Loss SizePictures::compare(const Reference& reference, const Picture& test) const {
  const PixelSpans spans = shown_spans(test);
  Loss loss{compare_flip(reference.flip, prepare_flip(test, spans)), 0};
  if (with_ssim_) {
    const PictureDifference d = compare_luma(reference.luma, prepare_luma(test, spans));
    loss.dssim = static_cast<double>(d.pixels) - d.ssim;
  }
  return loss;
}

/// Writes one loss of each shot that was taken. The reference is rendered together with shots of S_0, which
/// share most of the work.
void SizePictures::compare_view(std::size_t view, const std::vector<Shot>& shots,
                                const std::vector<std::size_t>& taken, std::vector<Losses>& out,
                                const RunContext& context) {
  PictureView at{
      view, place_picture(studio_.frame, static_cast<int>(view), studio_.views.views, displayed_px_), {}};
  at.bands = choose_bands(studio_.rows[view], at.place.side_px,
                          studio_.pixels_of_unit * displayed_px_ * displayed_px_);
  const auto put = [&at](const PictureVariants& shown, std::size_t i, Picture& to) {
    shown.put(i, to);
    at.bands.cut(to);
  };
  const auto compare_group = [&](const ScaleShots& group, const Reference* seen, const RunContext& run) {
    std::vector<const ShotMaterials*> materials;
    if (!seen) materials.push_back(&source_);
    for (const std::size_t i : group.shots) materials.push_back(shots[i].materials);
    if (materials.empty()) return;
    const PictureVariants shown = pictures(group.scale, at, materials, run);
    const std::size_t first = seen ? 0 : 1;
    if (!seen) {
      Picture source;
      put(shown, 0, source);
      seen = &(seen_[view] = {with_ssim_ ? prepare_luma(source) : LumaPicture{}, prepare_flip(source)});
    }
    parallel_for(run, group.shots.size(), 1, [&](std::size_t begin, std::size_t end) {
      Picture picture;
      for (std::size_t i = begin; i < end; ++i) {
        put(shown, first + i, picture);
        out[group.shots[i]][view] = compare(*seen, picture);
      }
    });
  };
  std::vector<ScaleShots> groups = by_scale(shots, taken);
  ScaleShots finest;
  if (const auto found = std::ranges::find(groups, 0u, &ScaleShots::scale); found != groups.end()) {
    finest = std::move(*found);
    groups.erase(found);
  }
  const auto known = seen_.find(view);
  compare_group(finest, known == seen_.end() ? nullptr : &known->second, context);
  const Reference& seen = seen_.at(view);
  RunContext serial = context;
  serial.threads = 1;
  parallel_for(context, groups.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) compare_group(groups[g], &seen, serial);
  });
}

std::vector<Losses> SizePictures::take(const std::vector<Shot>& shots, const RunContext& context) {
  const auto views = static_cast<std::size_t>(studio_.views.views);
  std::vector<Losses> out(shots.size(), Losses(views));
  for (std::size_t v = 0; v < views; ++v) {
    std::vector<std::size_t> taken;
    for (std::size_t i = 0; i < shots.size(); ++i)
      if (studio_.views.has(v, shots[i].views) && !ended(shots[i], out[i])) taken.push_back(i);
    if (!taken.empty()) compare_view(v, shots, taken, out, context);
  }
  return out;
}

bool ShotLimits::hold(const Loss& loss) const {
  constexpr double kPart = 0.95;
  return loss.flip.mean() <= mean && loss.flip.percentile(kPart) <= p95;
}

void Loss::add(const Loss& other) {
  flip.add(other.flip);
  dssim += other.dssim;
}

double Loss::mean_dssim() const {
  return flip.pixels ? std::clamp(dssim / static_cast<double>(flip.pixels), 0.0, 1.0) : 0;
}

Loss pooled(const Losses& losses) {
  Loss sum;
  for (const Loss& loss : losses) sum.add(loss);
  return sum;
}

Loss pooled(const Losses& losses, const Losses& like) {
  Loss sum;
  for (std::size_t v = 0; v < losses.size(); ++v)
    if (like[v].flip.pixels > 0) sum.add(losses[v]);
  return sum;
}

}  // namespace texmesh
