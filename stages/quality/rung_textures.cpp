#include "stages/quality/rung_textures.h"

#include <algorithm>
#include <cstdlib>

#include "stages/base/parallel.h"
#include "stages/fragment_codec/decode_rung.h"

namespace texmesh::quality {
namespace {

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
std::int32_t nearest_rung(const PlaneLadder& plane, int quality) {
  std::size_t best = 0;
  for (std::size_t r = 1; r < plane.rungs.size(); ++r)
    if (std::abs(plane.rungs[r].quality - quality) < std::abs(plane.rungs[best].quality - quality)) best = r;
  return static_cast<std::int32_t>(best);
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

/// Where a plane's channels lie among those of a texture's level.
struct Channels {
  std::uint32_t first = 0, count = 1;
};

/// Writes the part of a block that lies on the level; (x0, y0) is the block's place there.
void put_block(const Pixels& block, std::uint32_t x0, std::uint32_t y0, Channels channels, Pixels& level) {
  for (std::uint32_t y = 0; y < block.height_px && y0 + y < level.height_px; ++y)
    for (std::uint32_t x = 0; x < block.width_px && x0 + x < level.width_px; ++x) {
      const std::uint8_t* from = block.at(x, y);
      std::uint8_t* to = level.data.data() +
                         ((std::size_t{y0} + y) * level.width_px + x0 + x) * level.channels + channels.first;
      for (std::uint32_t c = 0; c < channels.count; ++c) to[c] = from[block.channels >= 3 ? c : 0];
    }
}

struct PlaneSource {
  const TexturePlane& plane;
  const Pixels& pixels;
  const PlaneLadder& ladder;
  std::int32_t rung;
  bool srgb;
};

void put_plane(const PlaneSource& from, std::uint32_t first_level, Channels channels, Pixels& level,
               const RunContext& context) {
  const TexturePlane& plane = from.plane;
  const std::uint64_t most_pixels =
      static_cast<std::uint64_t>(plane.fragment_width_px) * plane.fragment_height_px;
  RunContext serial = context;
  serial.threads = 1;
  parallel_for(context, plane.fragment_count(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) {
      const auto rung = static_cast<std::size_t>(from.rung);
      const bool stored = from.rung != kSourceRung && !fragment_stream(from.ladder.rungs[rung], f).empty();
      const TexelRectangle place = padded_fragment_rectangle(plane, f);
      Pixels block = stored ? decode_fragment(from.ladder, rung, f, most_pixels) : cut(from.pixels, place);
      block = coarser_level(std::move(block), from.srgb, first_level, serial);
      put_block(block, place.left_px >> first_level, place.top_px >> first_level, channels, level);
    }
  });
}

}  // namespace

RungChoice source_choice(const Fragments& fragments) {
  return {100, std::vector<std::int32_t>(fragments.planes.size(), kSourceRung)};
}

std::vector<RungChoice> sampled_choices(const ShownTextures& shown, const Fragments& fragments,
                                        const Ladder& ladder, int samples) {
  if (!shown.sampled_plane) return {source_choice(fragments)};
  std::vector<RungChoice> out;
  const PlaneLadder& sampled = ladder.planes[*shown.sampled_plane];
  for (const std::size_t r : spread_rungs(sampled.rungs.size(), samples)) {
    RungChoice& choice = out.emplace_back();
    choice.quality = sampled.rungs[r].quality;
    for (const PlaneLadder& plane : ladder.planes)
      choice.rungs.push_back(nearest_rung(plane, choice.quality));
  }
  return out;
}

std::vector<RenderTexture> textures_of(const ShownTextures& shown, const Fragments& fragments,
                                       const std::vector<Pixels>& pixels, const Ladder& ladder,
                                       const RungChoice& choice,
                                       const std::vector<std::uint32_t>& first_levels,
                                       const RunContext& context) {
  std::vector<RenderTexture> out;
  for (std::size_t t = 0; t < shown.textures.size(); ++t) {
    const ShownTexture& from = shown.textures[t];
    const TexturePlane& plane = fragments.planes[from.plane];
    RenderTexture& texture = out.emplace_back();
    texture.width_px = plane.width_px;
    texture.height_px = plane.height_px;
    texture.srgb = from.srgb;
    // A mip has whole texels of both axes.
    texture.first_level = first_levels[t];
    while (std::min(plane.width_px, plane.height_px) >> texture.first_level == 0) --texture.first_level;
    const std::uint32_t colours = plane.channels >= 3 ? 3 : 1;
    Pixels& level = texture.levels.emplace_back();
    level.width_px = plane.width_px >> texture.first_level;
    level.height_px = plane.height_px >> texture.first_level;
    level.channels = colours + (from.alpha ? 1 : 0);
    level.data.resize(std::size_t{level.width_px} * level.height_px * level.channels);
    const auto put = [&](std::uint32_t p, bool srgb, Channels channels) {
      put_plane({fragments.planes[p], pixels[p], ladder.planes[p], choice.rungs[p], srgb},
                texture.first_level, channels, level, context);
    };
    put(from.plane, from.srgb, {0, colours});
    if (from.alpha) put(*from.alpha, false, {colours, 1});
    complete_mips(texture, context);
  }
  return out;
}

}  // namespace texmesh::quality
