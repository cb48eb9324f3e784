#include "stages/quality/quality.h"

#include <algorithm>
#include <cmath>
#include <list>
#include <string>

#include "format/base/box.h"
#include "stages/base/parallel.h"
#include "stages/geometry/scale_frames.h"
#include "stages/measure/flip.h"
#include "stages/measure/image_compare.h"
#include "stages/quality/rung_textures.h"
#include "stages/render/shade.h"

namespace texmesh {
namespace {

using quality::LevelCount;
using quality::RungChoice;
using quality::ShownTextures;
using TextureSizes = std::vector<Vec2<std::uint32_t>>;  // per shown texture, px

/// Of all pixels of all views: where S_0 covers less, the pictures compare next to nothing. A thread across
/// the whole picture, one pixel wide, covers 0.5 %.
constexpr double kLeastCovered = 0.002;

BoundingSphere sphere_of(const Mesh& mesh) {
  if (mesh.positions.empty()) throw StageError("quality", "S_0", "positions", "none");
  const BoundingSphere sphere = bounding_sphere(mesh.positions);
  if (!(sphere.radius > 0)) throw StageError("quality", "S_0", "an extent above 0", "one point");
  return sphere;
}

/// The sphere around the place where nearly all positions lie, whatever a few others do.
BoundingSphere crowd_sphere(const Mesh& mesh, const BoundingSphere& bounds) {
  constexpr double kCrowd = 0.98, kMargin = 1.25;
  const std::size_t n = mesh.positions.size();
  BoundingSphere s;
  std::vector<double> values(n);
  const auto at_rank = [&](std::size_t rank) {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(rank), values.end());
    return values[rank];
  };
  for (int k = 0; k < 3; ++k) {
    for (std::size_t p = 0; p < n; ++p) values[p] = mesh.positions[p][k];
    s.centre[k] = at_rank(n / 2);
  }
  for (std::size_t p = 0; p < n; ++p) values[p] = length(to_double(mesh.positions[p]) - s.centre);
  s.radius = kMargin * at_rank(static_cast<std::size_t>(kCrowd * static_cast<double>(n - 1)));
  return s.radius > 0 && s.radius < bounds.radius ? s : bounds;
}

/// What all pictures share.
struct Studio {
  std::vector<RenderScene> scenes;  // per kept scale, S_0 first
  std::vector<RenderTexture> source;
  std::vector<std::vector<RenderTexture>> rungs;  // per column
  RenderEnvironment environment;
};

struct ReferencePicture {
  LumaPicture luma;
  FlipPicture flip;
};
ReferencePicture prepare_reference(const Picture& picture) {
  return {prepare_luma(picture), prepare_flip(picture)};
}

PictureDifference difference_of(const ReferencePicture& reference, const Picture& test) {
  PictureDifference sum = compare_luma(reference.luma, prepare_luma(test));
  sum.difference = flip_of(reference.flip, prepare_flip(test)) * static_cast<double>(sum.pixels);
  return sum;
}

/// Everything that one view compares: [scale][rung]. One view at a time is in memory.
std::vector<PictureDifference> measure_view(const Studio& studio, const RenderCamera& camera,
                                            std::uint32_t side, const RunContext& context) {
  const std::size_t rungs = studio.rungs.size();
  const Visibility finest = look(studio.scenes[0], camera, side, context);
  const ReferencePicture original =
      prepare_reference(shade(studio.scenes[0], finest, studio.source, studio.environment, context));
  std::vector<PictureDifference> found(studio.scenes.size() * rungs);
  RunContext serial = context;
  serial.threads = 1;
  parallel_for(context, studio.scenes.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      const Visibility coarser = s == 0 ? Visibility{} : look(studio.scenes[s], camera, side, serial);
      const Visibility& view = s == 0 ? finest : coarser;
      for (std::size_t r = 0; r < rungs; ++r) {
        PictureDifference& cell = found[s * rungs + r];
        if (r > 0 && studio.source.empty()) {  // nothing that shows has rungs
          cell = found[s * rungs];
          continue;
        }
        cell = difference_of(original,
                             shade(studio.scenes[s], view, studio.rungs[r], studio.environment, serial));
      }
    }
  });
  return found;
}

RenderCamera camera_of_view(int view, const QualityTable& table, const BoundingSphere& sphere) {
  return perspective_camera(camera_of(view, static_cast<int>(table.views), sphere.centre, sphere.radius));
}

/// What the views show of S_0.
struct Coverage {
  std::uint64_t pixels = 0;
  LevelCount levels;
};

Coverage coverage_of_views(const RenderScene& scene, const BoundingSphere& sphere, const TextureSizes& sizes,
                           const QualityTable& table, const RunContext& context) {
  Coverage seen{0, LevelCount(sizes.size())};
  for (int v = 0; v < static_cast<int>(table.views); ++v) {
    context.check_cancelled();
    const Visibility view = look(scene, camera_of_view(v, table, sphere), table.size_px, context);
    for (std::size_t i = 0; i + 1 < view.first.size(); ++i) seen.pixels += view.first[i] < view.first[i + 1];
    seen.levels.add(scene, view, sizes);
  }
  return seen;
}

std::string count_outside(const Mesh& mesh, const BoundingSphere& sphere) {
  const auto outside = std::count_if(mesh.positions.begin(), mesh.positions.end(), [&](Vec3f p) {
    return length(to_double(p) - sphere.centre) > sphere.radius;
  });
  return std::to_string(outside) + " of " + std::to_string(mesh.positions.size());
}

/// Chooses the sphere that the pictures frame, and returns what they show. It is the object's sphere, unless
/// that one shows next to nothing of the object and the crowd's sphere shows more.
Coverage frame_object(const RenderScene& scene, const TextureSizes& sizes, const QualityTable& table,
                      BoundingSphere& sphere, Notes& notes, const RunContext& context) {
  const double all = static_cast<double>(table.views) * table.size_px * table.size_px;
  Coverage seen = coverage_of_views(scene, sphere, sizes, table, context);
  if (static_cast<double>(seen.pixels) >= kLeastCovered * all) return seen;
  const BoundingSphere crowd = crowd_sphere(*scene.mesh, sphere);
  if (crowd.radius < sphere.radius) {
    Coverage closer = coverage_of_views(scene, crowd, sizes, table, context);
    if (closer.pixels > seen.pixels) {
      sphere = crowd;
      add_warning(notes, "far-outliers", "",
                  "quality was measured without the " + count_outside(*scene.mesh, crowd) +
                      " positions that lie so far from all others that pictures of the whole object show "
                      "next to nothing");
      seen = std::move(closer);
    }
  }
  return seen;
}

/// Means over all covered pixels of all views. Without a covered pixel the pictures count as equal.
void fill_table(QualityTable& table, const std::vector<std::vector<PictureDifference>>& views, Notes& notes) {
  for (std::size_t i = 0; i < views[0].size(); ++i) {
    PictureDifference sum;
    for (const auto& view : views) {
      sum.ssim += view[i].ssim;
      sum.difference += view[i].difference;
      sum.pixels += view[i].pixels;
    }
    if (sum.pixels == 0 && i == 0)
      add_warning(notes, "quality-not-measured", "",
                  "no picture of " + std::to_string(table.size_px) +
                      " px shows anything of the object; its scales count as equal");
    if (sum.pixels == 0) sum = {1, 0, 1};
    const auto n = static_cast<double>(sum.pixels);
    table.ssim.push_back(static_cast<float>(std::clamp(sum.ssim / n, 0.0, 1.0)));
    table.difference.push_back(static_cast<float>(std::clamp(sum.difference / n, 0.0, 1.0)));
  }
}

}  // namespace

MeasuredQuality measure_quality(const NestedScales& scales, const PerceptualValues& perceptual,
                                const std::vector<Material>& materials, const Fragments& fragments,
                                const std::vector<Pixels>& pixels, const Ladder& ladder,
                                const QualityOptions& options, const RunContext& context) {
  BoundingSphere sphere = sphere_of(scales.mesh);
  const ShownTextures shown = quality::find_shown(materials, fragments, scales.mesh);
  TextureSizes sizes;
  for (const quality::ShownTexture& t : shown.textures)
    sizes.push_back({fragments.planes[t.plane].width_px, fragments.planes[t.plane].height_px});
  MeasuredQuality result;
  QualityTable& table = result.table;
  table.views = static_cast<std::uint32_t>(options.views);
  table.size_px = static_cast<std::uint32_t>(options.size_px);
  Studio studio;
  std::list<Mesh> coarser;  // as their files light them
  for (std::size_t k = 0; k < scales.scales.size(); ++k) {
    const NestedScale& scale = scales.scales[k];
    if (k > 0 && !perceptual.kept[k]) continue;
    table.scales.push_back(scale.scale);
    if (k > 0) coarser.push_back(lit_scale(scales, k, context));
    studio.scenes.push_back(k > 0 ? render_scene(coarser.back(), shown.materials, sizes.size())
                                  : RenderScene{&scales.mesh, &scale.triangles, &scale.triangle_source,
                                                &shown.materials, sizes.size()});
  }

  const Coverage seen = frame_object(studio.scenes[0], sizes, table, sphere, result.notes, context);
  const std::vector<std::uint32_t> first = seen.levels.first_levels();
  const auto textures = [&](const RungChoice& choice) {
    return quality::textures_of(shown, fragments, pixels, ladder, choice, first, context);
  };
  studio.environment = studio_environment(context);
  studio.source = textures(quality::source_choice(fragments));
  for (const RungChoice& choice : quality::sampled_choices(shown, fragments, ladder, options.rung_samples)) {
    table.rungs.push_back(choice.quality);
    studio.rungs.push_back(textures(choice));
  }

  std::vector<std::vector<PictureDifference>> found;
  for (int v = 0; v < options.views; ++v) {
    context.report((v + 1.0) / (options.views + 1.0));
    found.push_back(measure_view(studio, camera_of_view(v, table, sphere), table.size_px, context));
  }
  fill_table(table, found, result.notes);
  return result;
}

}  // namespace texmesh
