#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "format/rules/allocation.h"
#include "stages/image/decode_image.h"
#include "tools/inspect/debug/debug_view.h"
#include "tools/inspect/package_mesh.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kPaintedSide = 1024;  // longest side of a painted texture
constexpr double kBright = 0.75;              // share of a colour that follows the texture's brightness

/// A texture's grid with what is known of its fragments.
struct PaintedGrid {
  std::uint32_t width_px = 0, height_px = 0, fragment_width_px = 0, fragment_height_px = 0, columns = 0;
  std::vector<float> eta;
  std::vector<std::uint32_t> covered_texels;
  Pixels under;  // the texture at any resolution
};

double brightness(const Pixels& p, double u, double v) {
  const auto x = std::min(static_cast<std::uint32_t>(u * p.width_px), p.width_px - 1),
             y = std::min(static_cast<std::uint32_t>(v * p.height_px), p.height_px - 1);
  const std::uint8_t* t = p.at(x, y);
  if (p.channels < 3) return t[0] / 255.0;
  return (0.299 * t[0] + 0.587 * t[1] + 0.114 * t[2]) / 255.0;
}

Pixels paint(const PaintedGrid& grid) {
  const double shrink =
      std::min(1.0, kPaintedSide / static_cast<double>(std::max(grid.width_px, grid.height_px)));
  Pixels out;
  out.width_px = std::max(1u, static_cast<std::uint32_t>(grid.width_px * shrink));
  out.height_px = std::max(1u, static_cast<std::uint32_t>(grid.height_px * shrink));
  out.channels = 3;
  const auto fragment_at = [&](std::uint32_t x, std::uint32_t y) {
    const auto column = static_cast<std::uint32_t>((x + 0.5) / out.width_px * grid.width_px) /
                        grid.fragment_width_px,
               row = static_cast<std::uint32_t>((y + 0.5) / out.height_px * grid.height_px) /
                     grid.fragment_height_px;
    return row * grid.columns + column;
  };
  for (std::uint32_t y = 0; y < out.height_px; ++y)
    for (std::uint32_t x = 0; x < out.width_px; ++x) {
      const std::uint32_t f = fragment_at(x, y);
      const bool line = (x > 0 && fragment_at(x - 1, y) != f) || (y > 0 && fragment_at(x, y - 1) != f);
      const bool stored = grid.covered_texels[f] > 0;
      const Srgb c = stored ? colour_of(static_cast<double>(grid.eta[f])) : Srgb{128, 128, 128};
      const double light =
          line ? 0
               : 1 - kBright +
                     kBright * brightness(grid.under, (x + 0.5) / out.width_px, (y + 0.5) / out.height_px);
      for (std::uint8_t s : c) out.data.push_back(static_cast<std::uint8_t>(s * light + 0.5));
    }
  return out;
}

DebugLegend legend_of(const std::vector<PaintedGrid>& grids) {
  DebugLegend legend{
      "eta: feature density of a fragment at S_0, which orders what is sent", "", 0, 1, false, true, {}, {}};
  for (int k = 0; k <= 4; ++k) legend.stops.emplace_back(k / 4.0, colour_of(k / 4.0));
  legend.remarks.push_back(
      "brightness is the texture's; black lines part fragments; grey fragments are not stored because no "
      "triangle shows them");
  for (std::size_t k = 0; k < grids.size(); ++k) {
    const auto& covered = grids[k].covered_texels;
    const auto stored = std::count_if(covered.begin(), covered.end(), [](std::uint32_t c) { return c > 0; });
    legend.remarks.push_back(fmt::format("texture {}: {} x {} px, {} x {} fragments of {} x {} px, {} stored",
                                         k, grids[k].width_px, grids[k].height_px, grids[k].columns,
                                         covered.size() / grids[k].columns, grids[k].fragment_width_px,
                                         grids[k].fragment_height_px, stored));
  }
  return legend;
}

/// `grid_of_image`: per image the materials speak of, the grid that shows it, -1 = none.
DebugView assemble(const Mesh& mesh, std::vector<Material> materials,
                   const std::vector<std::int32_t>& grid_of_image, const std::vector<PaintedGrid>& grids) {
  DebugView view;
  view.mesh = mesh;
  view.mesh.colours.clear();
  for (Material& m : materials) {
    Material plain;
    plain.name = m.name;
    plain.metallic = 0;
    plain.double_sided = true;
    plain.base_colour_texture = m.base_colour_texture;
    std::int32_t& image = plain.base_colour_texture.image;
    image = image >= 0 ? grid_of_image.at(static_cast<std::size_t>(image)) : -1;
    if (image < 0) plain.base_colour = {0.5f, 0.5f, 0.5f, 1};
    view.materials.push_back(plain);
  }
  for (const PaintedGrid& grid : grids) view.textures.push_back(paint(grid));
  view.legend = legend_of(grids);
  return view;
}

[[noreturn]] void fail_untextured(const std::string& file) {
  throw InputError(file, "--what fragments", "a model with a base-colour texture",
                   "none; persistence, skeleton, R and collapse-error can be seen of it");
}

Pixels decode(const std::string& name, std::vector<std::uint8_t> bytes) {
  return decode_image(probe_image(name, std::move(bytes), {}));
}

PaintedGrid grid_of(PackageReader& package, std::uint32_t plane) {
  const TextureInfo& info = package.textures()[plane];
  const PlaneTables& tables = package.tables().planes.at(plane);
  return {
      info.width_px, info.height_px,    info.fragment_width_px, info.fragment_height_px,
      info.columns,  eta_of(tables, 0), tables.covered_texels,  decode("preview", package.preview(plane))};
}

}  // namespace

DebugView view_fragments(const ConditionedMesh& mesh, const std::vector<Material>& materials,
                         const std::vector<Image>& images, const Fragments& fragments) {
  std::vector<std::int32_t> grid_of_image(images.size(), -1);
  std::vector<PaintedGrid> grids;
  for (const TexturePlane& plane : fragments.planes) {
    if (plane.role != TextureRole::kBaseColour || grid_of_image.at(plane.image) >= 0) continue;
    grid_of_image[plane.image] = static_cast<std::int32_t>(grids.size());
    const auto count = static_cast<std::ptrdiff_t>(plane.fragment_count());
    grids.push_back({plane.width_px,
                     plane.height_px,
                     plane.fragment_width_px,
                     plane.fragment_height_px,
                     plane.columns,
                     {plane.eta.begin(), plane.eta.begin() + count},
                     plane.covered_texels,
                     decode_image(images[plane.image])});
  }
  if (grids.empty()) fail_untextured("");
  return assemble(mesh.mesh, materials, grid_of_image, grids);
}

DebugView view_fragments(PackageReader& package, const RunContext& context) {
  const ImportedModel s0 = finest_scale(package, context);
  std::vector<std::int32_t> grid_of_image(s0.model.images.size(), -1);
  std::vector<PaintedGrid> grids;
  for (std::size_t i = 0; i < s0.model.images.size(); ++i) {
    const std::int32_t plane = plane_of_image(package.textures(), s0.model.images[i].name);
    if (plane < 0 || package.textures()[static_cast<std::size_t>(plane)].role != "base-colour") continue;
    grid_of_image[i] = static_cast<std::int32_t>(grids.size());
    grids.push_back(grid_of(package, static_cast<std::uint32_t>(plane)));
  }
  if (grids.empty()) fail_untextured(package.store().name());
  return assemble(s0.model.mesh, s0.model.materials, grid_of_image, grids);
}

}  // namespace texmesh
