// What of the stages' results users look at: scales (which vertices are features), fragments (what orders the
// texture's parts) and the atlas (the charts that the texture is cut into), each painted on the surface.
#include "tools/inspect/pictures/painted_model.h"

#include <fmt/format.h>

#include "format/base/buckets.h"
#include "format/base/portable_math.h"
#include "format/rules/allocation.h"
#include "pipeline/compile/stage_table.h"
#include "pipeline/io/table.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/image/decode_image.h"
#include "tools/inspect/atlas/atlas_report.h"
#include "tools/inspect/package_mesh.h"

namespace texmesh {
namespace {

/// Nine colours of the widely used "viridis" scale, eighths apart.
constexpr std::array<Srgb, 9> kScale{{{68, 1, 84},
                                      {71, 44, 122},
                                      {59, 81, 139},
                                      {44, 113, 142},
                                      {33, 144, 141},
                                      {39, 173, 129},
                                      {92, 200, 99},
                                      {170, 220, 50},
                                      {253, 231, 37}}};
Vec4f linear_colour(Srgb c) {
  Vec4f out{0, 0, 0, 1};
  for (std::size_t k = 0; k < 3; ++k) {
    const double s = c[k] / 255.0;
    const double x = light_of_srgb(s);
    (k == 0 ? out.x : k == 1 ? out.y : out.z) = static_cast<float>(x);
  }
  return out;
}

double fraction_of(const ColourLegend& legend, double value) {
  double lo = legend.lo, hi = legend.hi;
  if (legend.logarithmic) lo = portable::log(lo), hi = portable::log(hi), value = portable::log(value);
  return hi > lo ? std::clamp((value - lo) / (hi - lo), 0.0, 1.0) : 0;
}

void add_stops(ColourLegend& legend) {
  constexpr std::array<const char*, 5> kNames{"dark violet", "blue", "teal", "green", "yellow"};
  for (std::size_t k = 0; k < kNames.size(); ++k) {
    const double f = static_cast<double>(k) / (kNames.size() - 1);
    const double value = legend.logarithmic
                             ? portable::exp(portable::log(legend.lo) +
                                             f * (portable::log(legend.hi) - portable::log(legend.lo)))
                             : legend.lo + f * (legend.hi - legend.lo);
    legend.stops.push_back({value, colour_of(f), kNames[k]});
  }
}

[[noreturn]] void fail_values(std::size_t positions, std::size_t values, const char* what) {
  throw StageError("painting", what, std::to_string(positions) + " positions", std::to_string(values));
}

/// By position its neighbours along the edges; with repetitions.
Buckets<std::uint32_t> neighbours_of(const Mesh& m) {
  return in_buckets(m.positions.size(), [&](auto&& put) {
    for (std::uint32_t t = 0; t < m.triangles.size(); ++t)
      for (int k = 0; k < 3; ++k)
        for (int other = 1; other < 3; ++other) put(m.position_of(t, k), m.position_of(t, (k + other) % 3));
  });
}

/// A feature of a large scale is one vertex for all that are nearer than the distance that features of that
/// scale keep; on a dense mesh a line of them would be specks. Each is painted half as large: they touch.
std::vector<double> spread_features(const ConditionedMesh& mesh, const ScaleMap& map) {
  const Mesh& m = mesh.mesh;
  const Buckets<std::uint32_t> neighbours = neighbours_of(m);
  const std::vector<Box3f> boxes = component_boxes(mesh.component, m.positions);
  const SsfOptions usual;
  std::vector<double> value(map.persistence.begin(), map.persistence.end());
  std::vector<std::uint32_t> seen_from(value.size(), kNoIndex), near;
  for (std::uint32_t feature = 0; feature < value.size(); ++feature) {
    const std::uint8_t scale = map.persistence[feature];
    const double diagonal = to_double(boxes[mesh.component[feature]]).diagonal();
    const double sigma = std::min<double>(map.sigma.at(scale), usual.sigma_max * diagonal);
    const double reach = 0.5 * feature_spacing(sigma, usual);
    near.assign(1, feature);
    seen_from[feature] = feature;
    for (std::size_t i = 0; i < near.size(); ++i)
      for (const std::uint32_t p : neighbours[near[i]]) {
        if (seen_from[p] == feature ||
            length(to_double(m.positions[p]) - to_double(m.positions[feature])) > reach)
          continue;
        seen_from[p] = feature;
        value[p] = std::max<double>(value[p], scale);
        near.push_back(p);
      }
  }
  return value;
}

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

ColourLegend fragments_legend(const std::vector<PaintedGrid>& grids) {
  ColourLegend legend{"eta: feature density of a fragment at S_0, which orders what is sent"};
  add_stops(legend);
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
PaintedModel assemble(const Mesh& mesh, std::vector<Material> materials,
                      const std::vector<std::int32_t>& grid_of_image, const std::vector<PaintedGrid>& grids) {
  PaintedModel view;
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
  view.legend = fragments_legend(grids);
  return view;
}

[[noreturn]] void fail_untextured(const std::string& file) {
  throw InputError(file, "--what fragments", "a model with a base-colour texture",
                   "none; scales can be seen of it");
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

ColourLegend atlas_legend(const AtlasReport& report) {
  ColourLegend legend{"atlas: the charts that the surface is cut into, each in a colour of its own"};
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

Srgb colour_on(std::span<const Srgb> scale, double fraction) {
  const double at = std::clamp(fraction, 0.0, 1.0) * static_cast<double>(scale.size() - 1);
  const auto low = std::min(static_cast<std::size_t>(at), scale.size() - 2);
  Srgb out{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double x = scale[low][k] + (at - static_cast<double>(low)) * (scale[low + 1][k] - scale[low][k]);
    out[k] = static_cast<std::uint8_t>(x + 0.5);
  }
  return out;
}

Srgb colour_of(double fraction) { return colour_on(kScale, fraction); }

std::string hex_of(Srgb c) { return fmt::format("#{:02x}{:02x}{:02x}", c[0], c[1], c[2]); }

std::string share_text(double count, double of) { return percent(of > 0 ? count / of : 0) + " %"; }

PaintedModel paint_values(const Mesh& source, const std::vector<double>& value, ColourLegend legend,
                          const char* what) {
  if (value.size() != source.positions.size()) fail_values(source.positions.size(), value.size(), what);
  PaintedModel view;
  view.mesh = source;
  view.mesh.uv0.clear(), view.mesh.uv1.clear();
  view.mesh.triangle_material.assign(source.triangles.size(), 0);
  view.materials.resize(1);
  view.materials[0].double_sided = true;
  view.materials[0].metallic = 0;
  add_stops(legend);
  view.mesh.colours.resize(source.wedge_count());
  for (std::size_t w = 0; w < source.wedge_count(); ++w)
    view.mesh.colours[w] = linear_colour(colour_of(fraction_of(legend, value[source.wedge_position[w]])));
  view.legend = std::move(legend);
  view.points.resize(value.size());
  for (std::size_t p = 0; p < value.size(); ++p)
    view.points[p] = {value[p], {}, to_double(source.positions[p]) + source.origin};
  for (std::size_t w = source.uv0.size(); w-- > 0;)  // of several corners the first one's
    view.points[source.wedge_position[w]].texture = source.uv0[w];
  return view;
}

PaintedModel paint_scales(const ConditionedMesh& mesh, const ScaleMap& scale_map) {
  if (scale_map.persistence.size() != mesh.mesh.positions.size())
    fail_values(mesh.mesh.positions.size(), scale_map.persistence.size(), "scale map");
  ColourLegend legend{"scales: highest scale at which a vertex is still a feature"};
  legend.hi = static_cast<double>(scale_map.scales);
  for (std::size_t scale = 0; scale < scale_map.sigma.size(); ++scale) {
    const auto count =
        std::ranges::count_if(scale_map.persistence, [&](std::size_t p) { return p >= scale; });
    legend.remarks.push_back(fmt::format(
        "S_{}: sigma {:.6g}, {} features, {} crossings, {:.4g} of the signal's range", scale,
        scale_map.sigma[scale], count, scale_map.crossings_at[scale], scale_map.convergence[scale]));
  }
  legend.remarks.push_back("features of a scale keep a distance; each is painted to the half of it");
  PaintedModel view =
      paint_values(mesh.mesh, spread_features(mesh, scale_map), std::move(legend), "scale map");
  for (std::size_t p = 0; p < view.points.size(); ++p) view.points[p].value = scale_map.persistence[p];
  return view;
}

PaintedModel paint_fragments(const ConditionedMesh& mesh, const std::vector<Material>& materials,
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

PaintedModel paint_fragments(PackageReader& package, const RunContext& context) {
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

PaintedModel paint_atlas(const Mesh& mesh, const std::vector<Material>& materials,
                         std::span<const AtlasImage> images) {
  const AtlasReport report = measure_atlases(mesh, materials, images, {});
  if (report.atlases.empty())
    throw InputError("", "--what atlas", "a model whose surface shows a texture",
                     "none; scales can be seen of it");
  PaintedModel view;
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

PaintedModel paint_atlas(PackageReader& package, const RunContext& context) {
  const AtlasSubject subject = atlas_subject(package, context);
  return paint_atlas(subject.mesh, subject.materials, subject.images);
}

namespace {

/// Of the mesh as the file has it: conditioning may cut it.
PaintedModel paint_imported_atlas(const ImportedMesh& imported, const std::vector<Material>& materials,
                                  const std::vector<Image>& images) {
  std::vector<AtlasImage> sides;
  for (const Image& image : images) sides.push_back({image.width_px, image.height_px, nullptr});
  return paint_atlas(imported.mesh, materials, sides);
}

constexpr PaintedQuantity kQuantities[] = {
    {"atlas", [] { return painting_stage(inputs(kImportedMesh, kMaterials, kImages), paint_imported_atlas); },
     paint_atlas},
    {"fragments",
     [] {
       return painting_stage<ConditionedMesh, std::vector<Material>, std::vector<Image>, Fragments>(
           inputs(kConditionedMesh, kMaterials, kImages, kFragments), paint_fragments);
     },
     paint_fragments},
    {"scales", [] { return painting_stage(inputs(kConditionedMesh, kScaleMap), paint_scales); }, nullptr}};

}  // namespace

std::span<const PaintedQuantity> painted_quantities() { return kQuantities; }

PaintedModel paint_model(const CompileRequest& request, const PaintedQuantity& what, Store& store,
                         const RunContext& context, const StageObserver& observer, Notes& notes) {
  return *run_towards(request, what.stage(), kPainted, store, context, observer, notes);
}

PaintedModel paint_package(const std::string& path, const PaintedQuantity& what, const RunContext& context) {
  if (!what.of_package)
    throw InputError(path, "--what " + std::string(what.name),
                     "the model it was compiled from: a package does not hold this", "a package");
  PackageReader package(open_store(path));
  return what.of_package(package, context);
}

}  // namespace texmesh
