#include "stages/quality/shots.h"

#include <algorithm>

#include "stages/base/parallel.h"
#include "stages/measure/image_compare.h"

namespace texmesh::quality {
namespace {

struct Reference {
  LumaPicture luma;
  FlipPicture flip;
};

/// The shots of one scale in one view.
struct ScaleShots {
  std::size_t scale = 0;
  std::vector<std::size_t> shots;
};
std::vector<ScaleShots> by_scale(const std::vector<Shot>& shots, const std::vector<std::size_t>& taken) {
  std::vector<ScaleShots> out;
  for (const std::size_t i : taken) {
    auto found = std::ranges::find(out, shots[i].scale, &ScaleShots::scale);
    if (found == out.end()) found = out.insert(out.end(), {shots[i].scale, {}});
    found->shots.push_back(i);
  }
  return out;
}

struct Task {
  const Studio& studio;
  const Materials& source;
  const std::vector<Shot>& shots;
  double displayed_px;
  bool with_ssim;

  /// One picture per list of materials.
  PictureVariants pictures(std::size_t scale, const PicturePlace& place,
                           const std::vector<const Materials*>& materials, const RunContext& context) const {
    RenderScene scene = studio.scenes[scale];
    scene.materials = materials.front();
    scene.texture_count = studio.textures.size();
    return shade_variants(scene, look(scene, place.camera, place.side_px, context), materials,
                          studio.textures, studio.environment, context);
  }
  PictureVariants pictures(const ScaleShots& of, const PicturePlace& place, bool with_source,
                           const RunContext& context) const {
    std::vector<const Materials*> materials;
    if (with_source) materials.push_back(&source);
    for (const std::size_t i : of.shots) materials.push_back(shots[i].materials);
    return pictures(of.scale, place, materials, context);
  }
  Reference reference(const Picture& shown) const {
    return {with_ssim ? prepare_luma(shown) : LumaPicture{}, prepare_flip(shown)};
  }
  Loss compare(const Reference& reference, const Picture& test) const {
    Loss loss{compare_flip(reference.flip, prepare_flip(test)), 0};
    if (with_ssim) {
      const PictureDifference d = compare_luma(reference.luma, prepare_luma(test));
      loss.dssim = static_cast<double>(d.pixels) - d.ssim;
    }
    return loss;
  }
  /// Writes one loss of each shot that was taken.
  void compare_view(std::size_t view, const PicturePlace& place, const std::vector<std::size_t>& taken,
                    std::vector<Losses>& out, const RunContext& context) const {
    std::vector<ScaleShots> groups = by_scale(shots, taken);
    ScaleShots finest;
    if (const auto found = std::ranges::find(groups, 0u, &ScaleShots::scale); found != groups.end()) {
      finest = std::move(*found);
      groups.erase(found);
    }
    const PictureVariants first = pictures(finest, place, true, context);
    const Reference seen = reference(first.picture(0));
    parallel_for(context, finest.shots.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        out[finest.shots[i]][view] = compare(seen, first.picture(i + 1));
    });
    RunContext serial = context;
    serial.threads = 1;
    parallel_for(context, groups.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t g = begin; g < end; ++g) {
        const PictureVariants shown = pictures(groups[g], place, false, serial);
        for (std::size_t i = 0; i < shown.count(); ++i)
          out[groups[g].shots[i]][view] = compare(seen, shown.picture(i));
      }
    });
  }
};

}  // namespace

void Loss::add(const Loss& other) {
  flip.add(other.flip);
  dssim += other.dssim;
}

double Loss::mean_dssim() const {
  return flip.pixels ? std::clamp(dssim / static_cast<double>(flip.pixels), 0.0, 1.0) : 0;
}

std::vector<Losses> take_shots(const Studio& studio, const Materials& source, double displayed_px,
                               const std::vector<Shot>& shots, bool with_ssim, const RunContext& context) {
  const Task task{studio, source, shots, displayed_px, with_ssim};
  std::vector<Losses> out(shots.size(), Losses(static_cast<std::size_t>(studio.views.views)));
  for (int v = 0; v < studio.views.views; ++v) {
    const auto view = static_cast<std::size_t>(v);
    std::vector<std::size_t> taken;
    for (std::size_t i = 0; i < shots.size(); ++i)
      if (studio.views.has(view, shots[i].views)) taken.push_back(i);
    if (taken.empty()) continue;
    const PicturePlace place = place_picture(studio.frame, v, studio.views.views, displayed_px);
    task.compare_view(view, place, taken, out, context);
  }
  return out;
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

}  // namespace texmesh::quality
