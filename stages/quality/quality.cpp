#include "stages/quality/quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "format/base/box.h"
#include "format/base/srgb.h"
#include "format/documents/allocation.h"
#include "stages/base/parallel.h"
#include "stages/fragment_codec/decode_rung.h"
#include "stages/measure/image_compare.h"
#include "stages/measure/render_view.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kMaxFirstLevel = 4;  // fragments' sides are multiples of 16
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

/// Planes that show: those that a material's base colour or emission samples.
struct ShownPlanes {
  std::vector<std::uint32_t> planes;                     // indices into Fragments::planes
  std::vector<std::int32_t> base_plane, emissive_plane;  // per material: index into `planes`, -1 = none
};

ShownPlanes find_shown(const std::vector<Material>& materials, const Fragments& fragments) {
  ShownPlanes shown;
  auto plane_of = [&](const TextureRef& ref) -> std::int32_t {
    for (std::uint32_t p = 0; ref.used() && p < fragments.planes.size(); ++p) {
      const TexturePlane& plane = fragments.planes[p];
      if (plane.image != static_cast<std::uint32_t>(ref.image) || plane.role == TextureRole::kAlpha ||
          plane.mip > 0)
        continue;
      const auto at = std::find(shown.planes.begin(), shown.planes.end(), p);
      const auto index = static_cast<std::int32_t>(at - shown.planes.begin());
      if (at == shown.planes.end()) shown.planes.push_back(p);
      return index;
    }
    return -1;
  };
  for (const Material& m : materials) {
    shown.base_plane.push_back(plane_of(m.base_colour_texture));
    shown.emissive_plane.push_back(plane_of(m.emissive_texture));
  }
  return shown;
}

ViewScene scene_of(const NestedScales& scales, const NestedScale& scale,
                   const std::vector<Material>& materials, const ShownPlanes& shown,
                   const Fragments& fragments) {
  ViewScene scene;
  scene.mesh = &scales.mesh;
  scene.triangles = &scale.triangles;
  scene.triangle_source = &scale.triangle_source;
  scene.materials = &materials;
  scene.base_plane = shown.base_plane;
  scene.emissive_plane = shown.emissive_plane;
  for (std::uint32_t p : shown.planes)
    scene.sizes.push_back({fragments.planes[p].width_px, fragments.planes[p].height_px});
  return scene;
}

/// Per plane, the finest level that more than 2 % of all samples of S_0 ask for: nothing finer is kept.
class LevelCount {
 public:
  explicit LevelCount(std::size_t planes) : wanted_(planes) {}
  void add(const ViewBuffer& view) {
    for (const ViewSample& s : view.samples) {
      add(s.base_plane, s.base_area);
      add(s.emissive_plane, s.emissive_area);
    }
  }
  std::vector<std::uint32_t> first_levels() const {
    std::vector<std::uint32_t> first(wanted_.size(), 0);
    for (std::size_t p = 0; p < first.size(); ++p) {
      std::uint64_t total = 0, finer = 0;
      for (std::uint64_t n : wanted_[p]) total += n;
      for (; first[p] < kMaxFirstLevel; ++first[p]) {
        finer += wanted_[p][first[p]];
        if (50 * finer > total) break;
      }
    }
    return first;
  }

 private:
  void add(std::int32_t plane, float area) {
    if (plane < 0) return;
    std::uint32_t level = 0;
    for (float limit = 2; area > limit && level < kMaxFirstLevel; limit *= 4) ++level;
    ++wanted_[static_cast<std::size_t>(plane)][level];
  }
  std::vector<std::array<std::uint64_t, kMaxFirstLevel + 1>> wanted_;
};

// Writes the box-filtered linear pixels of a block of the plane that starts at (x0, y0), multiples of
// 2^level.
void reduce_block(const Pixels& block, std::uint32_t x0, std::uint32_t y0, std::uint32_t level,
                  MipTexture::Level& out) {
  const auto& linear = light_of_bytes();
  const std::uint32_t step = 1u << level;
  const float scale = 1.f / static_cast<float>(step * step);
  for (std::uint32_t by = 0; by < block.height_px; by += step) {
    const std::uint32_t y = (y0 + by) >> level;
    if (y >= out.height) break;
    for (std::uint32_t bx = 0; bx < block.width_px; bx += step) {
      const std::uint32_t x = (x0 + bx) >> level;
      if (x >= out.width) break;
      Vec3f sum;
      for (std::uint32_t j = 0; j < step; ++j)
        for (std::uint32_t i = 0; i < step; ++i) {
          const std::uint8_t* c = block.at(bx + i, by + j);
          sum = sum + (block.channels >= 3 ? Vec3f{linear[c[0]], linear[c[1]], linear[c[2]]}
                                           : Vec3f{linear[c[0]], linear[c[0]], linear[c[0]]});
        }
      out.texels[static_cast<std::size_t>(y) * out.width + x] = sum * scale;
    }
  }
}

MipTexture empty_texture(const TexturePlane& plane, std::uint32_t first_level) {
  MipTexture t;
  t.width_px = plane.width_px;
  t.height_px = plane.height_px;
  t.first_level = first_level;
  t.levels.resize(1);
  MipTexture::Level& level = t.levels[0];
  level.width = std::max(1u, (plane.width_px + (1u << first_level) - 1) >> first_level);
  level.height = std::max(1u, (plane.height_px + (1u << first_level) - 1) >> first_level);
  level.texels.resize(static_cast<std::size_t>(level.width) * level.height);
  return t;
}

// A fragment of the source, cut out of the plane's pixels.
Pixels cut(const Pixels& pixels, const TexelRectangle& r) {
  Pixels out{r.width_px, r.height_px, pixels.channels, {}};
  for (std::uint32_t y = r.top_px; y < r.bottom_px(); ++y) {
    const std::uint8_t* row = pixels.at(r.left_px, y);
    out.data.insert(out.data.end(), row, row + std::size_t{r.width_px} * pixels.channels);
  }
  return out;
}

/// A plane as it looks at one rung, or (ladder == nullptr) as the source has it. Fragments that no rung
/// stores are never looked at and stay as in the source.
MipTexture plane_texture(const TexturePlane& plane, const Pixels& pixels, const PlaneLadder* ladder,
                         std::size_t rung, std::uint32_t first_level, const RunContext& context) {
  MipTexture texture = empty_texture(plane, first_level);
  const std::uint64_t fragment_pixels =
      static_cast<std::uint64_t>(plane.fragment_width_px) * plane.fragment_height_px;
  parallel_for(context, plane.fragment_count(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) {
      const bool stored = ladder && !fragment_stream(ladder->rungs[rung], f).empty();
      const TexelRectangle place = padded_fragment_rectangle(plane, f);
      const Pixels block = stored ? decode_fragment(*ladder, rung, f, fragment_pixels) : cut(pixels, place);
      reduce_block(block, place.left_px, place.top_px, first_level, texture.levels[0]);
    }
  });
  build_mips(texture);
  return texture;
}

/// Indices of `wanted` rungs spread over `count`, lowest and highest among them (one: the highest).
std::vector<std::size_t> spread_rungs(std::size_t count, int wanted) {
  std::vector<std::size_t> out;
  const auto n = static_cast<std::size_t>(wanted);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t k = n == 1 ? count - 1 : (i * (count - 1) + (n - 1) / 2) / (n - 1);
    if (out.empty() || k > out.back()) out.push_back(k);
  }
  return out;
}

/// Planes of other codecs or roles have other rungs.
std::size_t nearest_rung(const PlaneLadder& plane, int quality) {
  std::size_t best = 0;
  for (std::size_t r = 1; r < plane.rungs.size(); ++r)
    if (std::abs(plane.rungs[r].quality - quality) < std::abs(plane.rungs[best].quality - quality)) best = r;
  return best;
}

struct Textures {
  std::vector<int> quality;                    // per column of the table
  std::vector<MipTexture> source;              // per shown plane
  std::vector<std::vector<MipTexture>> rungs;  // [column][shown plane]
};

Textures decode_textures(const ShownPlanes& shown, const Fragments& fragments,
                         const std::vector<Pixels>& pixels, const Ladder& ladder,
                         const std::vector<std::uint32_t>& first, int rung_samples,
                         const RunContext& context) {
  Textures out;
  for (std::size_t i = 0; i < shown.planes.size(); ++i) {
    const std::uint32_t p = shown.planes[i];
    out.source.push_back(plane_texture(fragments.planes[p], pixels[p], nullptr, 0, first[i], context));
  }
  if (shown.planes.empty()) {
    out.quality = {100};
    out.rungs.resize(1);
    return out;
  }
  for (std::size_t r : spread_rungs(ladder.planes[shown.planes[0]].rungs.size(), rung_samples)) {
    out.quality.push_back(ladder.planes[shown.planes[0]].rungs[r].quality);
    std::vector<MipTexture>& column = out.rungs.emplace_back();
    for (std::size_t i = 0; i < shown.planes.size(); ++i) {
      const std::uint32_t p = shown.planes[i];
      const PlaneLadder& plane = ladder.planes[p];
      column.push_back(plane_texture(fragments.planes[p], pixels[p], &plane,
                                     nearest_rung(plane, out.quality.back()), first[i], context));
    }
  }
  return out;
}

/// Everything that one view compares: [scale][rung]. One view at a time is in memory.
std::vector<PictureDifference> measure_view(const std::vector<ViewScene>& scenes, const ViewCamera& camera,
                                            const Textures& textures, std::uint32_t side,
                                            const RunContext& context) {
  const std::size_t rungs = textures.rungs.size();
  const ViewBuffer finest = look_at(scenes[0], camera, side);
  const ComparedPicture original = prepare_comparison(draw(finest, textures.source));
  std::vector<PictureDifference> found(scenes.size() * rungs);
  parallel_for(context, scenes.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      const ViewBuffer coarser = s == 0 ? ViewBuffer{} : look_at(scenes[s], camera, side);
      const ViewBuffer& view = s == 0 ? finest : coarser;
      for (std::size_t r = 0; r < rungs; ++r)
        found[s * rungs + r] = compare_pictures(original, prepare_comparison(draw(view, textures.rungs[r])));
    }
  });
  return found;
}

/// What the views show of S_0.
struct Coverage {
  std::uint64_t pixels = 0;
  LevelCount levels;
};

Coverage coverage_of_views(const ViewScene& scene, const BoundingSphere& sphere, std::size_t planes,
                           const QualityTable& table, const RunContext& context) {
  const int views = static_cast<int>(table.views);
  Coverage seen{0, LevelCount(planes)};
  for (int v = 0; v < views; ++v) {
    context.check_cancelled();
    const ViewBuffer view = look_at(scene, camera_of(v, views, sphere.centre, sphere.radius), table.size_px);
    for (std::uint8_t hits : view.hits) seen.pixels += hits > 0;
    seen.levels.add(view);
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
Coverage frame_object(const ViewScene& scene, std::size_t planes, const QualityTable& table,
                      BoundingSphere& sphere, Notes& notes, const RunContext& context) {
  const double all = static_cast<double>(table.views) * table.size_px * table.size_px;
  Coverage seen = coverage_of_views(scene, sphere, planes, table, context);
  if (static_cast<double>(seen.pixels) >= kLeastCovered * all) return seen;
  const BoundingSphere crowd = crowd_sphere(*scene.mesh, sphere);
  if (crowd.radius < sphere.radius) {
    Coverage closer = coverage_of_views(scene, crowd, planes, table, context);
    if (closer.pixels > seen.pixels) {
      sphere = crowd;
      add_warning(notes, "far-outliers", "",
                  "quality was measured without the " + count_outside(*scene.mesh, crowd) +
                      " positions that lie so far from all others that pictures of the whole object show "
                      "next to nothing");
      seen = std::move(closer);
    }
  }
  if (seen.pixels == 0)
    add_warning(notes, "quality-not-measured", "",
                "no picture of " + std::to_string(table.size_px) +
                    " px shows anything of the object; its scales count as equal");
  return seen;
}

/// Means over all covered pixels of all views. Without a covered pixel the pictures count as equal.
void fill_table(QualityTable& table, const std::vector<std::vector<PictureDifference>>& views) {
  for (std::size_t i = 0; i < views[0].size(); ++i) {
    PictureDifference sum;
    for (const auto& view : views) {
      sum.ssim += view[i].ssim;
      sum.difference += view[i].difference;
      sum.pixels += view[i].pixels;
    }
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
  const ShownPlanes shown = find_shown(materials, fragments);
  MeasuredQuality result;
  QualityTable& table = result.table;
  table.views = static_cast<std::uint32_t>(options.views);
  table.size_px = static_cast<std::uint32_t>(options.size_px);
  std::vector<ViewScene> scenes;
  for (std::size_t k = 0; k < scales.scales.size(); ++k) {
    if (k > 0 && !perceptual.kept[k]) continue;
    table.scales.push_back(scales.scales[k].scale);
    scenes.push_back(scene_of(scales, scales.scales[k], materials, shown, fragments));
  }

  const Coverage seen = frame_object(scenes[0], shown.planes.size(), table, sphere, result.notes, context);
  const Textures textures = decode_textures(shown, fragments, pixels, ladder, seen.levels.first_levels(),
                                            options.rung_samples, context);
  table.rungs = textures.quality;

  std::vector<std::vector<PictureDifference>> found;
  for (int v = 0; v < options.views; ++v) {
    context.report((v + 1.0) / (options.views + 1.0));
    const ViewCamera camera = camera_of(v, options.views, sphere.centre, sphere.radius);
    found.push_back(measure_view(scenes, camera, textures, table.size_px, context));
  }
  fill_table(table, found);
  return result;
}

}  // namespace texmesh
