#include "stages/quality/coded_groups.h"

#include <algorithm>
#include <bit>
#include <cstdlib>

#include "format/rules/mip_choice.h"
#include "format/rules/rate_distortion.h"

namespace texmesh::quality {
namespace {

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

}  // namespace texmesh::quality
