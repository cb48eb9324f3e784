#include "stages/poster/poster.h"

#include "stages/jpeg/jpeg.h"
#include "stages/poster/poster_camera.h"
#include "stages/render/shade.h"

namespace texmesh {
namespace {

/// The file of the highest quality that fits; empty where none does.
Bytes best_jpeg(const Pixels& pixels, std::size_t max_bytes) {
  Bytes best;
  for (int low = 1, high = 100; low <= high;) {
    const int quality = (low + high) / 2;
    Bytes file = encode_jpeg(pixels, quality, Subsampling::k420);
    if (file.size() <= max_bytes) {
      best = std::move(file);
      low = quality + 1;
    } else {
      high = quality - 1;
    }
  }
  return best;
}

constexpr std::size_t kCoarseTriangles = 2000;

const NestedScale& coarse_scale(const NestedScales& scales) {
  const auto few = [](const NestedScale& s) { return s.triangles.size() <= kCoarseTriangles; };
  const auto found = std::find_if(scales.scales.begin(), scales.scales.end(), few);
  return found == scales.scales.end() ? scales.scales.back() : *found;
}

}  // namespace

Poster make_poster(const NestedScales& scales, const std::vector<Material>& materials,
                   const Fragments& fragments, const std::vector<Pixels>& pixels,
                   const PosterOptions& options, const RunContext& context) {
  if (options.size_px == 0) return {};
  if (scales.scales.empty()) throw StageError("poster", "scales", "S_0", "none");
  RunContext inner = context;
  inner.progress = nullptr;
  const auto wanted_px = static_cast<std::uint32_t>(options.size_px);
  const ShownMaterials shown =
      shown_materials(materials, fragments, pixels, scales.mesh, 2 * wanted_px, inner);
  const auto scene_of = [&](const NestedScale& scale) {
    return RenderScene{&scales.mesh, &scale.triangles, &scale.triangle_source, &shown.materials,
                       shown.textures.size()};
  };
  const RenderScene scene = scene_of(scales.scales.front());
  const RenderCamera camera = poster_camera(scene, scene_of(coarse_scale(scales)), inner);
  const RenderEnvironment environment = studio_environment();
  for (std::uint32_t side_px = wanted_px;; side_px /= 2) {
    context.check_cancelled();
    const Picture picture =
        shade(scene, look(scene, camera, side_px, inner), shown.textures, environment, inner);
    Poster result{best_jpeg(encode_srgb(picture), static_cast<std::size_t>(options.max_bytes)), side_px,
                  side_px};
    if (!result.file.empty()) {
      context.report(1);
      return result;
    }
    if (side_px == 1)
      throw StageError("poster", "the file", "at most " + std::to_string(options.max_bytes) + " bytes",
                       "more");
  }
}

}  // namespace texmesh
