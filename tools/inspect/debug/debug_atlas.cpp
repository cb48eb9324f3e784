#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "format/base/errors.h"
#include "format/base/no_index.h"
#include "stages/measure/atlas/atlas_map.h"
#include "tools/inspect/atlas/atlas_report.h"
#include "tools/inspect/debug/debug_view.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kLayoutSide = 2048;  // longest side of a painted texture
constexpr Srgb kEmpty{36, 36, 36}, kThin{230, 30, 20}, kShared{255, 0, 255};

/// Neighbours in number are far apart in hue, between yellow and violet: red and magenta mean something.
Srgb chart_colour(std::uint32_t chart) {
  constexpr double kGolden = 0.618033988749895;
  const double along = chart * kGolden - std::floor(chart * kGolden);
  const double hue = 1 + 3.5 * along;  // in sixths of the circle: 1 = yellow, 2 = green, 4 = blue
  const double value = 0.6 + 0.35 * ((chart * 7 % 5) / 4.0);
  const auto channel = [&](double offset) {  // of HSV, saturation 0.6
    const double k = std::fmod(offset + hue, 6.0);
    return static_cast<std::uint8_t>(255 * value * (1 - 0.6 * std::clamp(std::min(k, 4 - k), 0.0, 1.0)) +
                                     0.5);
  };
  return {channel(5), channel(3), channel(1)};
}

Pixels paint_charts(const AtlasMap& map, const AtlasReport& report) {
  std::vector<Srgb> colours;
  for (std::uint32_t c = 0; c < report.charts.size(); ++c)
    colours.push_back(report.charts[c].is_thin() ? kThin : chart_colour(c));
  Pixels out{map.width_px, map.height_px, 3, {}};
  out.data.reserve(map.chart.size() * 3);
  for (std::size_t i = 0; i < map.chart.size(); ++i) {
    const bool empty = map.chart[i] == kNoIndex;
    const Srgb c = empty ? kEmpty : map.layers[i] > 1 ? kShared : colours[map.chart[i]];
    out.data.insert(out.data.end(), c.begin(), c.end());
  }
  return out;
}

/// Matt, with the painted copy of its guide texture in place of that; grey without one.
Material painted(const Material& material, std::uint32_t index, const AtlasReport& report) {
  Material out;
  out.name = material.name;
  out.metallic = 0;
  out.double_sided = true;
  out.base_colour = {0.5f, 0.5f, 0.5f, 1};
  for (std::size_t a = 0; a < report.atlases.size(); ++a) {
    const AtlasFigures& atlas = report.atlases[a];
    if (std::ranges::find(atlas.materials, index) == atlas.materials.end()) continue;
    for_each_texture(material, [&](const TextureRef& t) {
      if (out.base_colour_texture.used() || t.image != static_cast<std::int32_t>(atlas.image)) return;
      out.base_colour_texture = t;
      out.base_colour_texture.image = static_cast<std::int32_t>(a);
      out.base_colour = {1, 1, 1, 1};
    });
  }
  return out;
}

DebugLegend atlas_legend(const AtlasReport& report) {
  DebugLegend legend;
  legend.quantity = "atlas: the charts that the surface is cut into, each in a colour of its own";
  legend.coloured = false;
  legend.remarks.push_back(fmt::format(
      "red: charts thinner than {} texels; magenta: texels that two places of the surface show; dark: "
      "texels that nothing shows; grey surface: no texture",
      kThinTexels));
  for (const AtlasFigures& a : report.atlases)
    legend.remarks.push_back(fmt::format(
        "texture {}: {} x {} px, {} charts, {} thin, {:.1f} % of the texels shown, {:.1f} % of these twice or more",
        a.image, a.width_px, a.height_px, a.charts, a.thin_charts, 100 * a.cover, 100 * a.overlap));
  return legend;
}

}  // namespace

DebugView view_atlas(const Mesh& mesh, const std::vector<Material>& materials,
                     std::span<const AtlasImage> images) {
  const AtlasReport report = measure_atlases(mesh, materials, images, {});
  if (report.atlases.empty())
    throw InputError("", "--what atlas", "a model whose surface shows a texture",
                     "none; persistence, skeleton, R and collapse-error can be seen of it");
  DebugView view;
  view.mesh = mesh;
  view.mesh.colours.clear();
  for (std::uint32_t m = 0; m < materials.size(); ++m)
    view.materials.push_back(painted(materials[m], m, report));
  for (std::size_t a = 0; a < report.atlases.size(); ++a)
    view.textures.push_back(
        paint_charts(map_atlas(mesh, materials, images, report, a, kLayoutSide, {}), report));
  view.legend = atlas_legend(report);
  view.shows_layout = true;
  return view;
}

DebugView view_atlas(PackageReader& package, const RunContext& context) {
  const AtlasSubject subject = atlas_subject(package, context);
  return view_atlas(subject.mesh, subject.materials, subject.images);
}

}  // namespace texmesh
