// Textures of the pictures: which ones show, how they are made of the source, of rungs, mips or previews, and
// which rungs are sampled as knots.
#include "stages/quality/textures.h"
#include <cstdlib>

#include "format/rules/allocation.h"
#include "format/rules/viewing.h"
#include "stages/base/parallel.h"
#include "stages/data/stage.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/decode_image.h"
#include "stages/image/pixel_window.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh {
namespace {

/// The full-size plane of an image; `alpha` = that of its alpha channel.
std::optional<std::uint32_t> plane_of(const Fragments& fragments, std::int32_t image, bool alpha) {
  for (std::uint32_t p = 0; p < fragments.planes.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    if (plane.image == static_cast<std::uint32_t>(image) && plane.mip == 0 &&
        (plane.role == TextureRole::kAlpha) == alpha)
      return p;
  }
  return std::nullopt;
}

bool shows(const Material& material, TextureUse use) {
  if (material.unlit) return use == TextureUse::kBaseColour;
  const Vec3f e = material.emissive;
  return use != TextureUse::kEmissive || e.x > 0 || e.y > 0 || e.z > 0;
}

/// Twice the area of a triangle in pixels; 0 = no such thing.
double area_in_picture(const RenderScene& scene, const Visibility& view, const Triangle& triangle) {
  const RenderCamera& camera = view.camera;
  const double scale = 0.5 * view.side_px / camera.tan_half_fov;
  Vec2d at[3];
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3d d = to_double(scene.mesh->positions[scene.mesh->wedge_position[triangle[k]]]) - camera.eye;
    const double away = -dot(d, camera.z);
    if (!(away > camera.near)) return 0;
    at[k] = {dot(d, camera.x) / away * scale, dot(d, camera.y) / away * scale};
  }
  const Vec2d a = at[1] - at[0], b = at[2] - at[0];
  return std::fabs(a.x * b.y - a.y * b.x);
}

/// Twice the area of a triangle in a texture of that size, in its texels.
double area_in_texture(const Mesh& mesh, const TextureSlot& slot, const Triangle& triangle,
                       Vec2<std::uint32_t> size) {
  const std::vector<Vec2f>& uv = slot.uv_set == 1 ? mesh.uv1 : mesh.uv0;
  if (uv.empty()) return 0;
  const Vec2f a = uv[triangle[1]] - uv[triangle[0]], b = uv[triangle[2]] - uv[triangle[0]];
  const Vec2f s = slot.transform.scale;
  return std::fabs((static_cast<double>(a.x) * static_cast<double>(b.y) -
                    static_cast<double>(a.y) * static_cast<double>(b.x)) *
                   static_cast<double>(s.x) * static_cast<double>(s.y) * size.x * size.y);
}

/// Where a plane's channels lie among those of a texture's level.
struct Channels {
  std::uint32_t first = 0, count = 1;
};

/// Writes the part of a block that lies on the level; (x0, y0) is the block's place there.
void put_block(const Pixels& block, std::uint32_t x0, std::uint32_t y0, Channels channels, Pixels& level) {
  if (x0 >= level.width_px) return;
  const std::uint32_t width = std::min(block.width_px, level.width_px - x0);
  const std::size_t step = block.channels >= 3 ? 1 : 0;
  for (std::uint32_t y = 0; y < block.height_px && y0 + y < level.height_px; ++y) {
    const std::uint8_t* from = block.at(0, y);
    std::uint8_t* to = level.data.data() + ((std::size_t{y0} + y) * level.width_px + x0) * level.channels;
    if (channels.count == block.channels && channels.count == level.channels) {
      std::copy_n(from, std::size_t{width} * level.channels, to);
      continue;
    }
    to += channels.first;
    for (std::uint32_t x = 0; x < width; ++x, from += block.channels, to += level.channels)
      for (std::uint32_t c = 0; c < channels.count; ++c) to[c] = from[c * step];
  }
}

/// Where texels of a level come from.
struct PlaneTexels {
  std::uint32_t plane = 0;
  std::optional<std::size_t> rung;  // nothing: the source
  bool srgb = false;
};

void put_plane(const TextureData& data, const PlaneTexels& from, std::uint32_t first_level, Channels channels,
               Pixels& level, const RunContext& context) {
  const TexturePlane& plane = data.fragments.planes[from.plane];
  const PlaneLadder& ladder = data.ladder.planes[from.plane];
  const Pixels& pixels = data.pixels[from.plane];
  const std::uint32_t halvings = first_level - plane.mip;
  const std::uint64_t most_pixels =
      static_cast<std::uint64_t>(plane.fragment_width_px) * plane.fragment_height_px;
  RunContext serial = context;
  serial.threads = 1;
  parallel_each(context, plane.fragment_count(), 1, [&](std::size_t f) {
    const bool stored = from.rung && !fragment_stream(ladder.rungs[*from.rung], f).empty();
    const TexelRectangle place = padded_fragment_rectangle(plane, f);
    Pixels block = stored ? decode_fragment(ladder, *from.rung, f, most_pixels) : cut(pixels, place);
    block = coarser_level(std::move(block), from.srgb, halvings, serial);
    put_block(block, place.left_px >> halvings, place.top_px >> halvings, channels, level);
  });
}

/// The largest mip of a plane that is not coarser than `level`.
std::uint32_t plane_towards(const TextureData& data, std::uint32_t plane, std::uint32_t level) {
  return plane_at_level(data.infos, plane, static_cast<double>(level));
}

/// That level, at most the last one with whole texels along both axes.
std::uint32_t whole_level(const TexturePlane& full_size, std::uint32_t level) {
  while (std::min(full_size.width_px, full_size.height_px) >> level == 0) --level;
  return level;
}

/// An empty texture with room for its first level.
RenderTexture empty_texture(const TexturePlane& full_size, const ShownTexture& shown,
                            std::uint32_t first_level) {
  RenderTexture texture;
  texture.width_px = full_size.width_px;
  texture.height_px = full_size.height_px;
  texture.srgb = shown.srgb;
  texture.first_level = whole_level(full_size, first_level);
  Pixels& level = texture.levels.emplace_back();
  level.width_px = full_size.width_px >> texture.first_level;
  level.height_px = full_size.height_px >> texture.first_level;
  level.channels = (full_size.channels >= 3 ? 3 : 1) + (shown.alpha ? 1 : 0);
  level.data.resize(std::size_t{level.width_px} * level.height_px * level.channels);
  return texture;
}

Pixels decoded_preview(const TextureData& data, std::uint32_t plane) {
  constexpr std::uint64_t kMaxPreviewPixels = 1u << 26;
  return decode_jpeg(data.previews.planes[plane].file, kMaxPreviewPixels);
}

/// Indices of `wanted` rungs spread over `count`, lowest and highest among them (one: the highest). Short
/// ladders repeat some, so that all sizes have the same number of knots.
std::vector<std::size_t> spread_rungs(std::size_t count, int wanted) {
  std::vector<std::size_t> out;
  const auto n = static_cast<std::size_t>(wanted);
  for (std::size_t i = 0; i < n; ++i)
    out.push_back(n == 1 ? count - 1 : (i * (count - 1) + (n - 1) / 2) / (n - 1));
  return out;
}

/// Planes of other codecs or roles have other rungs.
std::size_t nearest_rung(const PlaneLadder& plane, int quality) {
  std::size_t best = 0;
  for (std::size_t r = 1; r < plane.rungs.size(); ++r)
    if (std::abs(plane.rungs[r].quality - quality) < std::abs(plane.rungs[best].quality - quality)) best = r;
  return best;
}

void add_texels(const PlaneTables& tables, std::size_t rung, Knot& knot) {
  const std::vector<float> weights = surface_weights(tables);
  const std::size_t fragments = tables.fragment_count();
  for (std::size_t f = 0; f < fragments; ++f) {
    knot.dssim.push_back(static_cast<double>(tables.dssim[rung * fragments + f]));
    knot.weight.push_back(static_cast<double>(weights[f]));
  }
}

void weigh(Knot& knot) {
  double sum = 0, total = 0;
  for (std::size_t i = 0; i < knot.dssim.size(); ++i) {
    sum += knot.weight[i] * knot.dssim[i];
    total += knot.weight[i];
  }
  knot.mean_dssim = total > 0 ? sum / total : 0;
}

/// The knot's rung of a texture's plane or of one of its mips.
std::optional<PlaneRung> rung_of(const TextureData& data, const Knot& knot, std::uint32_t full_size) {
  for (const PlaneRung& r : knot.rungs) {
    const TexturePlane& plane = data.fragments.planes[r.plane];
    if ((plane.mip > 0 ? plane.base : r.plane) == full_size) return r;
  }
  return std::nullopt;
}

}  // namespace

ShownTextures find_shown(const std::vector<Material>& materials, const Fragments& fragments,
                         const Mesh& mesh) {
  ShownTextures shown;
  auto texture_of = [&](const TextureRef& ref, bool srgb) -> std::int32_t {
    const std::vector<Vec2f>& uv = ref.texcoord == 0 ? mesh.uv0 : mesh.uv1;
    const auto plane = plane_of(fragments, ref.image, false);
    if (ref.texcoord > 1 || uv.empty() || !plane) return -1;
    for (std::size_t t = 0; t < shown.textures.size(); ++t)
      if (shown.textures[t].plane == *plane && shown.textures[t].srgb == srgb)
        return static_cast<std::int32_t>(t);
    shown.textures.push_back({*plane, plane_of(fragments, ref.image, true), srgb, true});
    return static_cast<std::int32_t>(shown.textures.size() - 1);
  };
  for (const Material& m : materials)
    shown.materials.push_back(render_material(m, [&](const TextureRef& ref, TextureUse use) {
      return shows(m, use) ? texture_of(ref, is_srgb(use)) : -1;
    }));
  shown.sampled = shown.materials;
  // Of scales, small pictures stand for larger ones, in which a sampler without mips would not have to
  // flicker.
  for (RenderMaterial& m : shown.materials)
    for (TextureSlot& slot : m.textures) {
      if (slot.texture >= 0 && slot.min_filter != MinFilter::kTrilinear)
        shown.textures[static_cast<std::size_t>(slot.texture)].with_mips = false;
      slot.min_filter = MinFilter::kTrilinear;
    }
  return shown;
}

// By areas: the renderer goes by the longer side of a pixel's footprint, so it never asks for a finer mip.
void WantedMips::add(const RenderScene& scene, const Visibility& view,
                     const std::vector<Vec2<std::uint32_t>>& sizes, double magnification) {
  for (const RenderFragment& fragment : view.fragments) {
    const Triangle& triangle = (*scene.triangles)[fragment.triangle];
    const double pixels = area_in_picture(scene, view, triangle) * magnification * magnification;
    if (!(pixels > 0)) continue;
    for (const TextureSlot& slot : scene.material_of(fragment.triangle).textures) {
      if (slot.texture < 0) continue;
      const auto t = static_cast<std::size_t>(slot.texture);
      const double texels = area_in_texture(*scene.mesh, slot, triangle, sizes[t]);
      std::size_t level = 0;
      for (double limit = 4 * pixels; texels >= limit && level < kMaxFirstLevel; limit *= 4) ++level;
      ++wanted_[t][level];
    }
  }
}

std::vector<std::uint32_t> WantedMips::first_levels() const {
  std::vector<std::uint32_t> first(wanted_.size(), 0);
  for (std::size_t t = 0; t < first.size(); ++t) {
    std::uint64_t total = 0, finer = 0;
    for (const std::uint64_t n : wanted_[t]) total += n;
    for (; first[t] < kMaxFirstLevel; ++first[t]) {
      finer += wanted_[t][first[t]];
      if (50 * finer > total) break;
    }
  }
  return first;
}

TextureData texture_data(const std::vector<Image>& images, const Fragments& fragments,
                         const std::vector<Pixels>& pixels, const Ladder& ladder, const Previews& previews,
                         const PackageTables& tables) {
  TextureData data{images, fragments, pixels, ladder, previews, tables, {}};
  for (const TexturePlane& plane : fragments.planes) {
    TextureInfo& info = data.infos.emplace_back();
    info.mip = plane.mip;
    info.base = plane.base;
  }
  return data;
}

RenderTexture source_texture(const TextureData& data, const ShownTexture& shown, std::uint32_t first_level,
                             const RunContext& context) {
  const TexturePlane& plane = data.fragments.planes[shown.plane];
  if (plane.image >= data.images.size())
    throw StageError("quality", "images", "image " + std::to_string(plane.image), "none");
  return render_texture(
      decode_image(data.images[plane.image], shown.srgb ? FloatEncoding::kSrgb : FloatEncoding::kAsIs),
      shown.srgb, whole_level(plane, first_level), context);
}

RenderTexture uncoded_texture(const TextureData& data, const ShownTexture& shown, std::uint32_t first_level,
                              const RunContext& context) {
  RenderTexture texture = empty_texture(data.fragments.planes[shown.plane], shown, first_level);
  Pixels& level = texture.levels[0];
  const std::uint32_t colours = level.channels - (shown.alpha ? 1 : 0), first = texture.first_level;
  put_plane(data, {plane_towards(data, shown.plane, first), {}, shown.srgb}, first, {0, colours}, level,
            context);
  if (shown.alpha)
    put_plane(data, {plane_towards(data, *shown.alpha, first), {}, false}, first, {colours, 1}, level,
              context);
  complete_mips(texture, context);
  return texture;
}

RenderTexture coded_texture(const TextureData& data, const ShownTexture& shown, const PlaneRung& colour,
                            const std::optional<PlaneRung>& alpha, std::uint32_t first_level,
                            const RunContext& context) {
  RenderTexture texture = empty_texture(data.fragments.planes[shown.plane], shown, first_level);
  Pixels& level = texture.levels[0];
  const std::uint32_t colours = level.channels - (shown.alpha ? 1 : 0), first = texture.first_level;
  put_plane(data, {colour.plane, colour.rung, shown.srgb}, first, {0, colours}, level, context);
  if (alpha) put_plane(data, {alpha->plane, alpha->rung, false}, first, {colours, 1}, level, context);
  complete_mips(texture, context);
  return texture;
}

RenderTexture preview_texture(const TextureData& data, const ShownTexture& shown, const RunContext& context) {
  Pixels image = decoded_preview(data, shown.plane);
  if (shown.alpha) {
    const Pixels alpha = decoded_preview(data, *shown.alpha);  // each is as fine as its bytes allow
    Pixels both{image.width_px, image.height_px, image.channels + 1, {}};
    for (std::uint32_t y = 0; y < image.height_px; ++y)
      for (std::uint32_t x = 0; x < image.width_px; ++x) {
        both.data.insert(both.data.end(), image.at(x, y), image.at(x, y) + image.channels);
        both.data.push_back(
            *alpha.at(x * alpha.width_px / image.width_px, y * alpha.height_px / image.height_px));
      }
    image = std::move(both);
  }
  return render_texture(std::move(image), shown.srgb, 0, context);
}

RenderTexture best_texture(const TextureData& data, const ShownTexture& shown, std::uint32_t plane_level,
                           std::uint32_t first_level, const RunContext& context) {
  const auto best = [&](std::uint32_t p) {
    const std::uint32_t plane = plane_towards(data, p, plane_level);
    return PlaneRung{plane, data.ladder.planes[plane].rungs.size() - 1};
  };
  std::optional<PlaneRung> alpha;
  if (shown.alpha) alpha = best(*shown.alpha);
  return coded_texture(data, shown, best(shown.plane), alpha, first_level, context);
}

bool shows_source(const TextureData& data, const ShownTexture& shown, std::uint32_t first_level) {
  const auto is_source = [&](std::uint32_t plane) {
    return plane_towards(data, plane, first_level) == plane && data.ladder.planes[plane].source_rung;
  };
  return is_source(shown.plane);
}

std::vector<PlanesOfGroup> find_groups(const ShownTextures& shown, const Fragments& fragments) {
  std::vector<PlanesOfGroup> out;
  for (const PlaneGroup group : {PlaneGroup::kColour, PlaneGroup::kNormal, PlaneGroup::kData}) {
    PlanesOfGroup all{group, {}}, seen{group, {}};
    for (std::uint32_t p = 0; p < fragments.planes.size(); ++p) {
      const TexturePlane& plane = fragments.planes[p];
      if (plane.mip > 0 || group_of(enum_name(plane.role)) != group) continue;
      all.planes.push_back(p);
      const bool shows = std::any_of(shown.textures.begin(), shown.textures.end(),
                                     [&](const ShownTexture& t) { return t.plane == p || t.alpha == p; });
      if (shows) seen.planes.push_back(p);
    }
    if (!all.planes.empty()) out.push_back(seen.planes.empty() ? all : seen);
  }
  return out;
}

std::uint32_t shown_plane(const TextureData& data, std::uint32_t full_size, const Display& display) {
  const TexturePlane& plane = data.fragments.planes[full_size];
  const double level = display_level(data.tables.planes[full_size], display.surface_area,
                                     display.object_height, display.displayed_px);
  const int last = std::bit_width(std::min(plane.width_px, plane.height_px)) - 1;
  return plane_at_level(data.infos, full_size, std::min(level, static_cast<double>(last)));
}

double texel_level(const TextureData& data, const PlanesOfGroup& group, const Display& display) {
  double sum = 0, total = 0;
  for (const std::uint32_t p : group.planes) {
    const PlaneTables& tables = data.tables.planes[p];
    double surface = 0;
    for (const float s : tables.surface_fraction) surface += static_cast<double>(s);
    const double level =
        display_level(tables, display.surface_area, display.object_height, display.displayed_px);
    sum += surface * (data.fragments.planes[shown_plane(data, p, display)].mip - level);
    total += surface;
  }
  return total > 0 ? sum / total : 0;
}

std::vector<ShownMip> shown_mips(const TextureData& data, const PlanesOfGroup& group,
                                 const Display& display) {
  std::vector<ShownMip> out;
  double total = 0;
  for (const std::uint32_t p : group.planes) {
    double surface = 0;
    for (const float s : data.tables.planes[p].surface_fraction) surface += static_cast<double>(s);
    out.push_back({data.fragments.planes[shown_plane(data, p, display)].mip, surface});
    total += surface;
  }
  for (ShownMip& m : out) m.part = total > 0 ? m.part / total : 0;
  return out;
}

std::vector<Knot> sample_knots(const TextureData& data, const PlanesOfGroup& group, int samples,
                               const Display& display) {
  std::vector<std::uint32_t> planes;
  for (const std::uint32_t p : group.planes) planes.push_back(shown_plane(data, p, display));
  const std::vector<LadderRung>& first = data.ladder.planes[planes[0]].rungs;
  const std::vector<std::size_t> sampled = spread_rungs(first.size(), samples);
  std::vector<Knot> knots;
  for (auto r = sampled.rbegin(); r != sampled.rend(); ++r) {
    Knot& knot = knots.emplace_back();
    for (const std::uint32_t p : planes) {
      knot.rungs.push_back({p, nearest_rung(data.ladder.planes[p], first[*r].quality)});
      add_texels(data.tables.planes[p], knot.rungs.back().rung, knot);
    }
  }
  for (Knot& knot : knots) weigh(knot);
  return knots;
}

TextureMaker texture_at(const TextureData& data, const ShownTexture& shown, const Knot& knot,
                        std::uint32_t source_first_level) {
  const std::optional<PlaneRung> colour = rung_of(data, knot, shown.plane);
  if (!colour) return {};
  std::optional<PlaneRung> alpha;
  std::uint32_t level = std::max(source_first_level, data.fragments.planes[colour->plane].mip);
  if (shown.alpha) alpha = rung_of(data, knot, *shown.alpha);
  // Both stand in one texture: the coarser of them decides.
  if (alpha) level = std::max(level, data.fragments.planes[alpha->plane].mip);
  return [&data, &shown, colour, alpha, level](const RunContext& context) {
    return coded_texture(data, shown, *colour, alpha, level, context);
  };
}

std::optional<RenderTexture> preview_at(const TextureData& data, const ShownTexture& shown,
                                        const PlanesOfGroup& group, const RunContext& context) {
  if (std::ranges::find(group.planes, shown.plane) == group.planes.end()) return std::nullopt;
  return preview_texture(data, shown, context);
}

}  // namespace texmesh
