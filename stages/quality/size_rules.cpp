#include "stages/quality/size_rules.h"

#include <algorithm>
#include <cmath>

#include "format/rules/mip_choice.h"

namespace texmesh::quality {
namespace {

/// Of the least size, and of all where nothing follows from it.
bool is_all_rendered(const TextureSampler& sampler, std::size_t rank) {
  return rank == 0 || !sampler.shown.with_mips();
}

}  // namespace

std::size_t fewer_heights(const TextureSampler& sampler, std::size_t triangles, double object_height,
                          const QualityOptions& options) {
  // Texels of 0.7 pixels are the least. Those of a sampler that reads level 0 alone flicker where they are
  // smaller than pixels.
  constexpr double kTexelLevel = 0.5, kSharpTexelLevel = 0;
  constexpr double kLeastEnlargedPx = 128;  // below, a half height hardly costs anything
  constexpr double kTrianglePixels = 16, kSeenArea = 0.25, kSeenTriangles = 0.5;
  std::size_t fewer = 0;
  while (fewer + 1 < kSizes) {
    const double px = std::ldexp(options.largest_px, -static_cast<int>(fewer + 1));
    const double per_unit = px / object_height;
    const double pixels = kSeenArea * sampler.surface_area * per_unit * per_unit;
    if (px < kLeastEnlargedPx || pixels < kTrianglePixels * kSeenTriangles * static_cast<double>(triangles))
      break;
    const bool finer = std::ranges::any_of(sampler.shown.textures, [&](const ShownTexture& t) {
      return display_level(sampler.data.tables.planes[t.plane], sampler.surface_area, object_height, px) >
             (t.with_mips ? kTexelLevel : kSharpTexelLevel);
    });
    if (finer) break;
    ++fewer;
  }
  return fewer;
}

bool have_one_reference(const ShownTextures& shown) { return shown.with_mips(); }

bool repeats(const Knot& knot, const Knot& before) {
  return std::ranges::equal(knot.rungs, before.rungs,
                            [](const PlaneRung& a, const PlaneRung& b) { return a.rung == b.rung; });
}

bool is_sampled(const TextureSampler& sampler, const std::vector<Knot>& knots, std::size_t knot,
                std::size_t rank) {
  if (knot > 0 && repeats(knots[knot], knots[knot - 1])) return false;
  return is_all_rendered(sampler, rank) || repeats(knots[knot], knots.back()) || (rank == 1 && knot == 0);
}

MipSamples mip_samples(const TextureSampler& sampler, std::size_t rank, const Display& display,
                       const PlanesOfGroup& group) {
  if (is_all_rendered(sampler, rank)) return {kFinerLevels + 1, kCoarserLevels};
  Display smaller = display;
  smaller.displayed_px /= 2;
  const bool again = rank == 1 || std::ranges::any_of(group.planes, [&](std::uint32_t p) {
                       return shown_plane(sampler.data, p, smaller) == shown_plane(sampler.data, p, display);
                     });
  return {1, again ? std::size_t{1} : 0};
}

}  // namespace texmesh::quality
