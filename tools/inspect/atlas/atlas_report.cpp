#include "tools/inspect/atlas/atlas_report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pipeline/io/text_table.h"
#include "tools/inspect/atlas/atlas_advice.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

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
  TextTable table;
  table.column("figure", Align::kLeft);
  table.column("value");
  table.column("what it says", Align::kLeft);
  const auto of = [](std::uint64_t n, std::uint64_t all) {
    return all > 0 ? static_cast<double>(n) / static_cast<double>(all) : 0;
  };
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
  table.row({"seams", percent(of(a.seam_edges, a.edges)) + " %",
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

Json percentiles_json(const SurfacePercentiles& p) {
  return {{"p5", p.p5}, {"p50", p.p50}, {"p95", p.p95}, {"p99", p.p99}};
}

Json figures_json(const AtlasFigures& a, const std::string& name) {
  Json out{{"image", a.image},
           {"name", name},
           {"width_px", a.width_px},
           {"height_px", a.height_px},
           {"materials", a.materials},
           {"triangles", a.triangles},
           {"charts", a.charts},
           {"small_charts", a.small_charts},
           {"thin_charts", a.thin_charts},
           {"mirrored_charts", a.mirrored_charts},
           {"largest_chart", a.largest_chart},
           {"cover", a.cover},
           {"thin", a.thin_share},
           {"overlap", a.overlap},
           {"density", percentiles_json(a.density)},
           {"density_spread", a.density_spread()},
           {"stretch", percentiles_json(a.stretch)},
           {"flat_triangles", a.flat_triangles},
           {"flat_surface", a.flat_surface},
           {"folded_triangles", a.folded_triangles},
           {"far_triangles", a.far_triangles},
           {"edges", a.edges},
           {"seam_edges", a.seam_edges},
           {"positions", a.positions},
           {"vertices", a.vertices},
           {"triangle_floor", a.triangle_floor},
           {"seam_colours", nullptr}};
  if (a.seam_colours)
    out["seam_colours"] = {
        {"mean", a.seam_colours->mean}, {"p95", a.seam_colours->p95}, {"inside", a.seam_colours->inside}};
  return out;
}

}  // namespace

std::uint64_t AtlasDiagnosis::charts() const {
  std::uint64_t sum = 0;
  for (const AtlasFigures& a : report.atlases) sum += a.charts;
  return sum;
}

std::uint64_t AtlasDiagnosis::triangle_floor() const {
  std::uint64_t sum = 0;
  for (const AtlasFigures& a : report.atlases) sum += a.triangle_floor;
  return sum;
}

std::uint64_t AtlasDiagnosis::floor_bytes() const {
  return static_cast<std::uint64_t>(kBytesPerFloorTriangle * static_cast<double>(triangle_floor()));
}

AtlasDiagnosis diagnose_atlases(const AtlasSubject& subject, const RunContext& context) {
  AtlasDiagnosis out;
  out.report = measure_atlases(subject.mesh, subject.materials, subject.images, context);
  out.triangles = subject.mesh.triangles.size();
  for (const AtlasFigures& a : out.report.atlases) out.names.push_back(atlas_name(subject, a.image));
  for (const Material& m : subject.materials) out.materials.push_back(m.name);
  if (out.report.atlases.empty()) out.nothing = reason_for_none(subject);
  out.advice = advise(out);
  return out;
}

std::string atlas_text(const AtlasDiagnosis& d) {
  if (!d.nothing.empty()) return d.nothing + "\n";
  std::string out;
  for (std::size_t k = 0; k < d.report.atlases.size(); ++k) {
    const AtlasFigures& a = d.report.atlases[k];
    out += fmt::format("{}, {} x {} px, {}\n", d.names[k], a.width_px, a.height_px,
                       materials_of(a, d.materials)) +
           figures_text(a) + "\n";
  }
  if (d.report.untextured_triangles > 0)
    out += fmt::format("{} triangles show no texture\n", grouped(d.report.untextured_triangles));
  out += fmt::format(
      "in all: {} charts; a mesh that keeps them side by side has at least {} of {} triangles, about {} kB\n\n",
      grouped(d.charts()), grouped(d.triangle_floor()), grouped(d.triangles), kilobytes(d.floor_bytes()));
  if (d.advice.empty()) return out + "nothing to do: the atlas is sound\n";
  out += "what to do\n";
  for (const AtlasAdvice& a : d.advice)
    out += "- " + (a.atlas.empty() ? "" : a.atlas + ": ") + a.found + "\n  " + a.remedy + "\n";
  return out;
}

Json atlas_json(const AtlasDiagnosis& d) {
  Json atlases = Json::array(), advice = Json::array();
  for (std::size_t k = 0; k < d.report.atlases.size(); ++k)
    atlases.push_back(figures_json(d.report.atlases[k], d.names[k]));
  for (const AtlasAdvice& a : d.advice)
    advice.push_back({{"code", a.code}, {"atlas", a.atlas}, {"found", a.found}, {"remedy", a.remedy}});
  return {{"version", 1},
          {"triangles", d.triangles},
          {"untextured_triangles", d.report.untextured_triangles},
          {"charts", d.charts()},
          {"triangle_floor", d.triangle_floor()},
          {"floor_bytes", d.floor_bytes()},
          {"nothing", d.nothing},
          {"atlases", atlases},
          {"advice", advice}};
}

}  // namespace texmesh
