#include "stages/quality/shots.h"

#include <algorithm>

#include "stages/base/parallel.h"
#include "stages/measure/image_compare.h"

namespace texmesh::quality {
namespace {

struct Reference {
  Visibility seen;
  LumaPicture luma;
  FlipPicture flip;
};

struct Task {
  const Studio& studio;
  const Materials& source;
  double displayed_px;
  bool with_ssim;

  RenderScene scene(std::size_t scale, const Materials& materials) const {
    RenderScene out = studio.scenes[scale];
    out.materials = &materials;
    out.texture_count = studio.textures.size();
    return out;
  }
  Picture picture(const RenderScene& scene, const Visibility& seen, const RunContext& context) const {
    return shade(scene, seen, studio.textures, studio.environment, context);
  }
  Reference reference(const PicturePlace& place, const RunContext& context) const {
    const RenderScene finest = scene(0, source);
    Reference out{look(finest, place.camera, place.side_px, context), {}, {}};
    const Picture shown = picture(finest, out.seen, context);
    if (with_ssim) out.luma = prepare_luma(shown);
    out.flip = prepare_flip(shown);
    return out;
  }
  Loss compare(const Reference& reference, const PicturePlace& place, const Shot& shot,
               const RunContext& context) const {
    const RenderScene shown = scene(shot.scale, *shot.materials);
    const Visibility other =
        shot.scale == 0 ? Visibility{} : look(shown, place.camera, place.side_px, context);
    const Picture test = picture(shown, shot.scale == 0 ? reference.seen : other, context);
    Loss loss{compare_flip(reference.flip, prepare_flip(test)), 0};
    if (with_ssim) {
      const PictureDifference d = compare_luma(reference.luma, prepare_luma(test));
      loss.dssim = static_cast<double>(d.pixels) - d.ssim;
    }
    return loss;
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
  const Task task{studio, source, displayed_px, with_ssim};
  std::vector<Losses> out(shots.size(), Losses(static_cast<std::size_t>(studio.views.views)));
  RunContext serial = context;
  serial.threads = 1;
  for (int v = 0; v < studio.views.views; ++v) {
    const auto view = static_cast<std::size_t>(v);
    std::vector<std::size_t> taken;
    for (std::size_t i = 0; i < shots.size(); ++i)
      if (studio.views.has(view, shots[i].views)) taken.push_back(i);
    if (taken.empty()) continue;
    const PicturePlace place = place_picture(studio.frame, v, studio.views.views, displayed_px);
    const Reference reference = task.reference(place, context);
    parallel_for(context, taken.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        out[taken[i]][view] = task.compare(reference, place, shots[taken[i]], serial);
    });
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
