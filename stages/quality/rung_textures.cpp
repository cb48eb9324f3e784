#include "stages/quality/rung_textures.h"

#include <algorithm>
#include <string>

#include "format/rules/mip_choice.h"
#include "stages/base/parallel.h"
#include "stages/data/stage.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/decode_image.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh::quality {
namespace {

// A fragment of the source, cut out of the plane's pixels.
Pixels cut(const Pixels& pixels, const TexelRectangle& r) {
  Pixels out{r.width_px, r.height_px, pixels.channels, {}};
  for (std::uint32_t y = r.top_px; y < r.bottom_px(); ++y) {
    const std::uint8_t* row = pixels.at(r.left_px, y);
    out.data.insert(out.data.end(), row, row + std::size_t{r.width_px} * pixels.channels);
  }
  return out;
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
  parallel_for(context, plane.fragment_count(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) {
      const bool stored = from.rung && !fragment_stream(ladder.rungs[*from.rung], f).empty();
      const TexelRectangle place = padded_fragment_rectangle(plane, f);
      Pixels block = stored ? decode_fragment(ladder, *from.rung, f, most_pixels) : cut(pixels, place);
      block = coarser_level(std::move(block), from.srgb, halvings, serial);
      put_block(block, place.left_px >> halvings, place.top_px >> halvings, channels, level);
    }
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

}  // namespace

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

}  // namespace texmesh::quality
