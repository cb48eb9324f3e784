#include "tools/publish/report/fragment_maps.h"

#include <fmt/format.h>

#include <algorithm>

#include "format/rules/allocation.h"
#include "pipeline/io/markup.h"
#include "tools/publish/report/flip_colours.h"
#include "tools/publish/report/html.h"

namespace texmesh {
namespace {

constexpr double kLongerSide = 360;  // px on the page

FragmentHeat over_largest(std::string name, std::vector<double> value) {
  const double most = value.empty() ? 0 : *std::max_element(value.begin(), value.end());
  if (most > 0)
    for (double& v : value)
      if (v > 0) v /= most;
  return {std::move(name), std::move(value)};
}

}  // namespace

std::vector<FragmentHeat> fragment_heats(PackageReader& package, std::uint32_t plane) {
  const PlaneTables& t = package.tables().planes.at(plane);
  const std::size_t fragments = t.fragment_count();
  std::vector<double> bytes(fragments, -1), density(fragments, -1);
  const std::vector<float> eta = eta_of(t, 0);
  for (const std::uint16_t f : t.order) {
    const double texels = std::max<double>(t.covered_texels[f], 1);
    if (t.rung_count() > 0) bytes[f] = static_cast<double>(bytes_to_show(t, t.rung_count() - 1, f)) / texels;
    density[f] = static_cast<double>(eta[f]);
  }
  return {over_largest("bytes per texel at the best rung", std::move(bytes)),
          over_largest("feature density of S_0 (eta)", std::move(density))};
}

std::string fragment_map(PackageReader& package, std::uint32_t plane, const FragmentHeat& heat,
                         const std::string& preview) {
  const TextureInfo& t = package.textures().at(plane);
  const double shrink = kLongerSide / std::max(t.width_px, t.height_px);
  const double width = t.width_px * shrink, height = t.height_px * shrink;
  std::string out = fmt::format(
      "<svg class=\"map{}\" role=\"img\" aria-label=\"{}\" width=\"{:.0f}\" height=\"{:.0f}\" "
      "viewBox=\"0 0 {:.1f} {:.1f}\"><image href=\"{}\" width=\"{:.1f}\" height=\"{:.1f}\" "
      "preserveAspectRatio=\"none\"/>\n",
      heat.value.empty() ? "" : " heat",
      markup_escaped("Map of texture " + std::to_string(plane) + ": " + heat.name), width, height, width,
      height, markup_escaped(preview), width, height);
  const double w = t.fragment_width_px * shrink, h = t.fragment_height_px * shrink;
  for (std::size_t f = 0; f < std::size_t{t.columns} * t.rows; ++f) {
    const std::size_t column = f % t.columns, row = f / t.columns;
    const double x = static_cast<double>(column) * w, y = static_cast<double>(row) * h;
    if (heat.value.empty() || heat.value[f] < 0)
      out += fmt::format(
          "<path d=\"M{:.1f} {:.1f}h{:.1f}v{:.1f}h-{:.1f}z\" fill=\"none\" stroke=\"#888\" "
          "stroke-width=\".4\"/>\n",
          x, y, std::min(w, width - x), std::min(h, height - y), std::min(w, width - x));
    else
      out += fmt::format(
          "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\" "
          "fill-opacity=\".62\" stroke=\"#888\" stroke-width=\".4\"><title>row {}, column {}: "
          "{:.2f} of the largest</title></rect>\n",
          x, y, std::min(w, width - x), std::min(h, height - y), heat_hex(heat.value[f]), row, column,
          heat.value[f]);
  }
  return out + "</svg>\n";
}

}  // namespace texmesh
