// What an atlas is like, what of it costs, and what to do against that: a subject is measured, advice follows
// from figures beyond thresholds, and both are told as text and as JSON.
#include "tools/inspect/atlas/atlas_report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pipeline/io/table.h"
#include "stages/atlas_choice/atlas_choice.h"
#include "stages/base/parallel.h"
#include "stages/image/decode_image.h"
#include "tools/inspect/package_mesh.h"
#include "tools/render/rendered_model.h"

namespace texmesh {
namespace {

/// By image, whether some material has it as base colour. Other textures' seams say nothing: normals of two
/// charts differ because their axes do.
std::vector<bool> colour_images(const Model& model) {
  std::vector<bool> out(model.images.size());
  for (const Material& m : model.materials)
    if (m.base_colour_texture.used()) out.at(static_cast<std::size_t>(m.base_colour_texture.image)) = true;
  return out;
}

/// Everything but sides and colours of the images.
AtlasSubject bare_subject(Model&& model) {
  AtlasSubject out;
  for (const Image& image : model.images) out.image_names.push_back(image.name);
  out.images.resize(model.images.size());
  out.colours.resize(model.images.size());
  out.mesh = std::move(model.mesh);
  out.materials = std::move(model.materials);
  out.notes = std::move(model.notes);
  return out;
}

void point_at_colours(AtlasSubject& subject) {
  for (std::size_t i = 0; i < subject.images.size(); ++i)
    if (!subject.colours[i].data.empty()) subject.images[i].colours = &subject.colours[i];
}

constexpr double kManyFloorTriangles = 1500;  // a first picture of some 10 kB has no more
constexpr double kMuchThin = 0.05, kLittleCover = 0.5, kMuchOverlap = 0.01, kWideSpread = 4, kMuchStretch = 2;
constexpr double kVisibleSeams = 5;     // mean CIE difference; 2.3 can just be seen in flat colours
constexpr double kBeyondTexture = 1.5;  // so many times what the texture has anyway
constexpr double kManyBroken = 0.002;   // of the triangles, or of the surface
constexpr double kGoodCover = 0.75;     // what a packer reaches with charts of ordinary shapes
constexpr double kJustSeen = 2.3;

std::string percents(double share) { return fixed(100 * share, share < 0.0995 ? 1 : 0) + " %"; }

/// Two digits, and whole numbers from there on.
std::string rough(double x) { return shortest(x, x < 99.5 ? 2 : 3); }

using AdviceList = std::vector<AtlasAdvice>;

void advise_on_charts(const AtlasDiagnosis& d, AdviceList& out) {
  std::uint64_t small = 0;
  for (const NamedAtlas& a : d.atlases) small += a.small_charts;
  out.push_back(
      {"charts", "",
       fmt::format(
           "The texture is cut into {} charts; {} of them have at most {} triangles. A mesh that keeps every "
           "chart beside its neighbours has at least {} triangles, about {} kB, however small the object is "
           "shown. In coarser meshes charts are lost, and the texture tears.",
           grouped(d.charts()), grouped(small), kSmallChart, grouped(d.triangle_floor()),
           kilobytes(d.floor_bytes())),
       "Make a new atlas with fewer and larger charts: remove loose specks, close holes and smooth noise "
       "first, because unwrappers cut at creases; then unwrap the finished mesh and bake the texture onto "
       "it." +
           std::string(
               d.charts() < kFewCharts
                   ? ""
                   : " Or try compile --atlas auto: it makes larger charts where lit pictures then look "
                     "better for the same bytes. With --atlas rebuild close views touch about half the "
                     "texels.")});
}

void advise_on_packing(const NamedAtlas& a, AdviceList& out) {
  if (a.thin_share > kMuchThin)
    out.push_back(
        {"thin", a.name,
         fmt::format(
             "{} of the charts' texels lie in {} charts that are thinner than {} texels. Such charts "
             "mix with their surroundings where the texture is shown smaller, and in every block of a "
             "JPEG.",
             percents(a.thin_share), grouped(a.thin_charts), kThinTexels),
         "Join thin charts with their neighbours: raise the unwrapper's least chart size, or its limit for "
         "the angle at which it cuts."});
  const double shrink = std::sqrt(a.cover / kGoodCover);
  if (a.cover < kLittleCover)
    out.push_back(
        {"cover", a.name,
         fmt::format("Only {} of the texels are shown. The others take memory on every display, and bytes.",
                     percents(a.cover)),
         fmt::format(
             "Pack the charts again, 4 texels apart: {:.0f} x {:.0f} px hold what {} x {} px hold now.",
             std::ceil(a.width_px * shrink), std::ceil(a.height_px * shrink), a.width_px, a.height_px)});
  if (a.overlap > kMuchOverlap)
    out.push_back({"overlap", a.name,
                   fmt::format("{} of the shown texels are shown at two or more places of the surface. That "
                               "is right for tiles and for mirrored halves, and wrong for a scan: one place "
                               "has the other's colours.",
                               percents(a.overlap)),
                   "Where the object was scanned, unwrap it again without overlaps and bake the texture "
                   "again."});
}

void advise_on_looks(const NamedAtlas& a, AdviceList& out) {
  if (a.seam_colours && a.seam_colours->mean > kVisibleSeams &&
      a.seam_colours->mean > kBeyondTexture * a.seam_colours->inside)
    out.push_back(
        {"seams", a.name,
         fmt::format("Colours on both sides of seams differ by {} in the mean and {} along the worst "
                     "twentieth (CIE 1976; {} can just be seen), and by {} from one texel to the next. Seams "
                     "show as lines.",
                     rough(a.seam_colours->mean), rough(a.seam_colours->p95), kJustSeen,
                     rough(a.seam_colours->inside)),
         "Let the texturing equalise exposures and blend photos across charts, and continue each chart's "
         "colours some 4 texels beyond its border."});
  if (a.density_spread() > kWideSpread)
    out.push_back(
        {"density", a.name,
         fmt::format("The finest twentieth of the surface has {} times as many texels per length as the "
                     "coarsest twentieth. The fine parts cost bytes that nobody sees beside the coarse ones.",
                     shortest(a.density_spread(), 3)),
         "Scale the charts to one density when packing, or on purpose: more for a face than for a base."});
  if (a.stretch.p95 > kMuchStretch)
    out.push_back({"stretch", a.name,
                   fmt::format("On a twentieth of the surface texels are more than {} times as long as wide. "
                               "Details smear along them.",
                               rough(a.stretch.p95)),
                   "Cut strongly curved charts once more, or let the unwrapper relax them with a limit for "
                   "stretch."});
}

void advise_on_broken(const NamedAtlas& a, AdviceList& out) {
  if (a.flat_surface > kManyBroken)
    out.push_back({"flat", a.name,
                   fmt::format("{} triangles, {} of the surface, have no area on the texture: they show "
                               "single texels or lines.",
                               grouped(a.flat_triangles), percents(a.flat_surface)),
                   "Unwrap these triangles, or remove them when they are slivers of the reconstruction."});
  if (static_cast<double>(a.folded_triangles) > kManyBroken * static_cast<double>(a.triangles))
    out.push_back({"folded", a.name,
                   fmt::format("{} triangles are folded over inside their charts and show their neighbours' "
                               "texels mirrored.",
                               grouped(a.folded_triangles)),
                   "Unwrap the charts again with a method that forbids flips."});
  if (a.far_triangles > 0)
    out.push_back({"far", a.name,
                   fmt::format("{} triangles lie too far out on the texture, or over too many of its tiles, "
                               "to be measured.",
                               grouped(a.far_triangles)),
                   "Look at their texture coordinates: these are tiles or faults, not an atlas."});
}

/// What costs, the costliest first. Thresholds are where a good photogrammetry atlas is well clear of.
AdviceList advise(const AtlasDiagnosis& d) {
  AdviceList out;
  if (static_cast<double>(d.triangle_floor()) > kManyFloorTriangles) advise_on_charts(d, out);
  for (const NamedAtlas& a : d.atlases) {
    advise_on_packing(a, out);
    advise_on_looks(a, out);
    advise_on_broken(a, out);
  }
  return out;
}

/// Why a model has no atlas.
std::string reason_for_none(const AtlasSubject& subject) {
  const bool textures = std::ranges::any_of(subject.materials, [](const Material& m) {
    bool used = false;
    for_each_texture(m, [&](const TextureRef& t) { used |= t.used(); });
    return used;
  });
  if (!textures) return "No material has a texture, so there is no atlas to look at.";
  if (subject.mesh.uv0.empty() && subject.mesh.uv1.empty())
    return "The materials have textures, but the mesh has no texture coordinates: nothing of the textures is "
           "shown, and there is no atlas to look at.";
  return "No triangle shows a texture, so there is no atlas to look at.";
}

std::string atlas_name(const AtlasSubject& subject, std::uint32_t image) {
  const std::string& name = subject.image_names[image];
  return fmt::format("texture {}", image) + (name.empty() ? "" : " (" + printable(name) + ")");
}

std::string percentiles(const SurfacePercentiles& p) {
  return fmt::format("{} / {} / {}", shortest(p.p5, 3), shortest(p.p50, 3), shortest(p.p95, 3));
}

std::string materials_of(const AtlasFigures& a, const std::vector<std::string>& names) {
  constexpr std::size_t kMost = 3;
  std::string out;
  for (std::size_t k = 0; k < std::min(kMost, a.materials.size()); ++k) {
    const std::string& name = names[a.materials[k]];
    out += (k ? ", " : "") + (name.empty() ? std::to_string(a.materials[k]) : "\"" + printable(name) + "\"");
  }
  if (a.materials.size() > kMost) out += fmt::format(" and {} more", a.materials.size() - kMost);
  return fmt::format("material{} {}", a.materials.size() == 1 ? "" : "s", out);
}

std::string figures_text(const AtlasFigures& a) {
  Table table("", {Column::text("figure"), "value", Column::text("what it says")});
  const double seams = a.edges > 0 ? static_cast<double>(a.seam_edges) / static_cast<double>(a.edges) : 0;
  table.row(
      {"charts", grouped(a.charts),
       fmt::format("of {} triangles; {} charts have at most {}; the largest has {} % of the texels",
                   grouped(a.triangles), grouped(a.small_charts), kSmallChart, percent(a.largest_chart))});
  table.row({"cover", percent(a.cover) + " %", "texels that the surface shows, of all"});
  table.row({"thin", percent(a.thin_share) + " %",
             fmt::format("of the charts' texels lie in {} charts thinner than {} texels",
                         grouped(a.thin_charts), kThinTexels)});
  table.row({"overlap", percent(a.overlap) + " %",
             fmt::format("of the shown texels are shown twice or more; {} charts are mirrored",
                         grouped(a.mirrored_charts))});
  table.row({"density spread", shortest(a.density_spread(), 3),
             "times: texels per object unit " + percentiles(a.density) +
                 " (5, 50, 95 % of the surface have at most that)"});
  table.row({"stretch", shortest(a.stretch.p95, 3),
             fmt::format("long to wide on 95 % of the surface at most, {} on 50 %, {} on 99 %",
                         shortest(a.stretch.p50, 3), shortest(a.stretch.p99, 3))});
  table.row({"broken", grouped(a.flat_triangles + a.folded_triangles + a.far_triangles),
             fmt::format("triangles: {} without area on the texture, {} folded over, {} too far out",
                         grouped(a.flat_triangles), grouped(a.folded_triangles), grouped(a.far_triangles))});
  table.row({"seams", percent(seams) + " %",
             fmt::format("of the edges; seams make {} vertices of {} positions", grouped(a.vertices),
                         grouped(a.positions))});
  if (a.seam_colours)
    table.row({"seam colours", shortest(a.seam_colours->mean, 3),
               fmt::format(
                   "mean difference across seams (CIE 1976), {} along the worst 5 %; {} one texel further in",
                   shortest(a.seam_colours->p95, 3), shortest(a.seam_colours->inside, 3))});
  table.row({"triangle floor", grouped(a.triangle_floor),
             "fewest triangles of a mesh that keeps every chart beside its neighbours"});
  return table.text();
}

}  // namespace

AtlasSubject atlas_subject(Model model, const RunContext& context) {
  const std::vector<Image> images = std::move(model.images);
  model.images.clear();
  for (const Image& image : images) {
    model.images.emplace_back();
    model.images.back().name = image.name;
  }
  const std::vector<bool> decoded = colour_images(model);
  AtlasSubject out = bare_subject(std::move(model));
  parallel_each(context, images.size(), 1, [&](std::size_t i) {
    if (decoded[i]) out.colours[i] = decode_image(images[i], FloatEncoding::kSrgb);
  });
  for (std::size_t i = 0; i < images.size(); ++i)
    out.images[i] = {images[i].width_px, images[i].height_px, nullptr};
  point_at_colours(out);
  return out;
}

AtlasSubject atlas_subject(const std::string& path, const RunContext& context) {
  ImportedModel imported = import_file(path, {}, context);
  return with_model_named(path, [&] { return atlas_subject(std::move(imported.model), context); });
}

AtlasSubject atlas_subject(PackageReader& package, const RunContext& context) {
  Model model = finest_scale(package, context).model;
  const std::vector<bool> decoded = colour_images(model);
  AtlasSubject out = bare_subject(std::move(model));
  for (std::size_t i = 0; i < out.images.size(); ++i) {
    const std::int32_t plane = plane_of_image(package.textures(), out.image_names[i]);
    if (plane < 0) continue;  // a picture that belongs to no texture stays without sides: it is no atlas
    const TextureInfo& info = package.textures()[static_cast<std::size_t>(plane)];
    out.images[i] = {info.width_px, info.height_px, nullptr};
    out.image_names[i] = info.name;
    if (decoded[i])
      out.colours[i] = read_plane(package, static_cast<std::uint32_t>(plane), kBestRung, context);
  }
  point_at_colours(out);
  return out;
}

std::uint64_t AtlasDiagnosis::sum(std::uint64_t AtlasFigures::*figure) const {
  std::uint64_t sum = 0;
  for (const NamedAtlas& a : atlases) sum += a.*figure;
  return sum;
}

std::uint64_t AtlasDiagnosis::floor_bytes() const {
  return static_cast<std::uint64_t>(kBytesPerFloorTriangle * static_cast<double>(triangle_floor()));
}

AtlasDiagnosis diagnose_atlases(const AtlasSubject& subject, const RunContext& context) {
  AtlasDiagnosis out;
  AtlasReport report = measure_atlases(subject.mesh, subject.materials, subject.images, context);
  out.triangles = subject.mesh.triangles.size();
  out.untextured_triangles = report.untextured_triangles;
  for (AtlasFigures& a : report.atlases) {
    const std::string name = atlas_name(subject, a.image);
    out.atlases.push_back({std::move(a), name});
  }
  for (const Material& m : subject.materials) out.materials.push_back(m.name);
  if (out.atlases.empty()) out.nothing = reason_for_none(subject);
  out.advice = advise(out);
  return out;
}

std::string atlas_text(const AtlasDiagnosis& d) {
  if (!d.nothing.empty()) return d.nothing + "\n";
  std::string out;
  for (const NamedAtlas& a : d.atlases)
    out +=
        fmt::format("{}, {} x {} px, {}\n", a.name, a.width_px, a.height_px, materials_of(a, d.materials)) +
        figures_text(a) + "\n";
  if (d.untextured_triangles > 0)
    out += fmt::format("{} triangles show no texture\n", grouped(d.untextured_triangles));
  out += fmt::format(
      "in all: {} charts; a mesh that keeps them side by side has at least {} of {} triangles, about {} kB\n\n",
      grouped(d.charts()), grouped(d.triangle_floor()), grouped(d.triangles), kilobytes(d.floor_bytes()));
  if (d.advice.empty()) return out + "nothing to do: the atlas is sound\n";
  out += "what to do\n";
  for (const AtlasAdvice& a : d.advice)
    out += "- " + (a.atlas.empty() ? "" : a.atlas + ": ") + a.found + "\n  " + a.remedy + "\n";
  return out;
}

std::string auto_atlas_text(const AtlasDiagnosis& d) {
  const std::string keeps = "compile --atlas auto keeps the source's atlas: ";
  if (!d.nothing.empty()) return keeps + "there is none to make anew";
  if (d.charts() < kFewCharts) return keeps + fmt::format("{} charts are few", grouped(d.charts()));
  return fmt::format(
      "compile --atlas auto compares lit pictures of this atlas and of a new one, since {} charts are many; "
      "compile says which it takes",
      grouped(d.charts()));
}

}  // namespace texmesh
