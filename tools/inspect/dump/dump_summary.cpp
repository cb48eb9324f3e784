// The page to read first: what the object is, what a client's first request brings, scales, proxies, the step
// function, textures, bytes by kind, and the options that differ from the defaults.
#include <fmt/format.h>

#include <algorithm>

#include "format/rules/viewing.h"
#include "pipeline/io/table.h"
#include "tools/inspect/dump/dump_parts.h"
#include "tools/inspect/dump/package_figures.h"
#include "tools/inspect/provenance.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

std::string vector_text(const Vec3d& v) {
  return fmt::format("{}  {}  {}", shortest(v.x, 7), shortest(v.y, 7), shortest(v.z, 7));
}

Json vector_json(const Vec3d& v) { return Json{v.x, v.y, v.z}; }

/// A displayed size: people see whole pixels, and "any" for what is enough at any size.
Cell pixels(double px) {
  return {px, px >= kAnyDisplayPx ? "any" : grouped(static_cast<std::uint64_t>(px + 0.5))};
}

/// The least distance, in object heights, at which a step is shown; nothing = at any distance.
std::optional<double> distance_of(const ManifestStep& step) {
  if (step.up_to_px >= kAnyDisplayPx) return std::nullopt;
  return viewing_distance(1, step.up_to_px, {});
}

Table scales_table(const Manifest& m) {
  Table table(
      "scales (errors in object units; px = displayed height up to which the scale is enough, by lit "
      "pictures, by the\njust-noticeable difference, by an error of one pixel, by its edges)",
      {{"scale", kScaleName, "scale"},
       {"triangles", kGrouped, "triangles"},
       {"vertices", kGrouped, "vertices"},
       {"kB", kKilobytes, "bytes"},
       "from",
       {"major", {}, "major"},
       {"max error", kShortest, "error_max"},
       {"rms error", kShortest, "error_rms"},
       {"p95", percent_form(2), "p95", "%"},
       {"p99", percent_form(2), "p99", "%"},
       {"flip", {}, "display_px_flip", "px"},
       {"jnd", {}, "display_px_jnd", "px"},
       {"error", {}, "display_px_error", "px"},
       {"edge", {}, "display_px_edge", "px"},
       Column::data("floor"),
       Column::data("path")});
  for (const ManifestScale& s : m.scales)
    table.row({s.scale, s.triangles, s.vertices, s.glb.bytes, s.has_glb() ? "file" : "stream", s.major,
               s.error_max, s.error_rms, s.p95, s.p99, pixels(s.display_px_flip), pixels(s.display_px_jnd),
               pixels(s.display_px_error), pixels(s.display_px_edge), s.floor, s.glb.path});
  return table;
}

Table stream_table(const SplitStreamHead& head) {
  Table table(fmt::format("vertex-split stream ({} bits per coordinate; kB from its start, head included)",
                          head.position.bits),
              {{"up to", kScaleName, "scale"},
               {"triangles", kGrouped, "triangles"},
               {"points", kGrouped, "points"},
               {"blocks", kGrouped, "blocks"},
               {"kB", kKilobytes, "bytes"},
               {"connectivity", kKilobytes, "connectivity"},
               {"positions", kKilobytes, "positions"},
               {"UV", kKilobytes, "uv"},
               {"others", kKilobytes, "others"}});
  for (const StreamFigures& f : stream_figures(head))
    table.row(
        {f.scale, f.triangles, f.points, f.blocks, f.bytes, f.connectivity, f.positions, f.uv, f.others});
  return table;
}

/// One step function. JSON has the distance as null where the step serves at any distance.
Table steps_table(const std::vector<ManifestStep>& steps) {
  Table table("", {{"px", {}, "up_to_px"}, {"show", kScaleName, "scale"}, {"distance", 3, "from_distance"}});
  for (const ManifestStep& s : steps) table.row({s.up_to_px, s.scale, distance_of(s)});
  return table;
}

/// The package's own step function beside those of single rules.
std::string steps_text(const Manifest& m) {
  const auto rule = [&](StepRule r) { return step_function(m.scales, r); };
  const std::vector<std::vector<ManifestStep>> rules{m.steps, rule(StepRule::kJnd), rule(StepRule::kError),
                                                     rule(StepRule::kEdge)};
  Table table(
      fmt::format(
          "step function: displayed height in px up to which a scale is shown, and the distance in object "
          "heights from\nwhich on that is (field of view {:.0f} degrees, {:.0f} px high); the package's own "
          "(by lit pictures), then\nby single rules",
          Camera{}.fov_degrees, Camera{}.viewport_px),
      {{"show", kScaleName}});
  for (const char* name : {"px", "JND px", "1 px error px", "O_V/E_S px"}) {
    table.column(name);
    table.column({"distance", shortest_form(3)});
  }
  for (auto s = m.scales.rbegin(); s != m.scales.rend(); ++s) {
    table.row({s->scale});
    for (const auto& steps : rules) {
      const auto step = std::ranges::find(steps, s->scale, &ManifestStep::scale);
      const bool none = step == steps.end();
      table.rows.back().push_back(none ? Cell() : pixels(step->up_to_px));
      const std::optional<double> distance = none ? std::nullopt : distance_of(*step);
      table.rows.back().push_back(none || distance ? Cell(distance) : Cell("any"));
    }
  }
  return table.text();
}

Table textures_table(PackageReader& p) {
  Table table(
      "textures (mip m has 1 / 2^m of the sides; grid and stored count fragments; kB of the lowest and "
      "the\nhighest rung, and of all)",
      {{"plane", 0, "plane"},
       {"image", 0, "image"},
       {"mip", 0, "mip"},
       Column::data("base"),
       Column::text("role", "role"),
       Column::text("name", "name"),
       {"width px", 0, "width_px"},
       {"height px", 0, "height_px"},
       Column::data("channels"),
       "grid",
       {"stored", 0, "fragments"},
       {"rungs", 0, "rungs"},
       {"lowest kB", kKilobytes},
       {"highest kB", kKilobytes},
       {"all kB", kKilobytes},
       Column::data("source_rung"),
       Column::data("source")});
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const TextureInfo& t = p.textures()[k];
    std::uint64_t all = t.tables.bytes;
    for (const EntryRef& rung : t.rungs) all += rung.bytes;
    table.row({k, t.image, t.mip, t.mip > 0 ? t.base : k, t.role, t.name, t.width_px, t.height_px, t.channels,
               fmt::format("{}x{}", t.columns, t.rows), stored_fragments(p.tables().planes[k]),
               t.rungs.size(), t.rungs.empty() ? Cell() : t.rungs.front().bytes,
               t.rungs.empty() ? Cell() : t.rungs.back().bytes, all, t.source_rung ? Cell(true) : Cell(),
               t.source_extension.empty() ? Cell() : Cell(t.source.path)});
  }
  return table;
}

Table kinds_table(const std::vector<KindBytes>& kinds, std::uint64_t sum) {
  Table table("", {Column::text("bytes by kind", "kind"),
                   {"entries", kGrouped, "entries"},
                   {"kB", kKilobytes, "bytes"},
                   {"%", percent_form()}});
  for (const KindBytes& k : kinds)
    table.row({k.kind, k.entries, k.bytes, static_cast<double>(k.bytes) / static_cast<double>(sum)});
  return table;
}

std::string proxies_text(const Manifest& m) {
  if (m.proxies.empty()) return "";
  Table table(
      "proxies (whole objects with an atlas of their own; mean FLIP of lit pictures at displayed heights in px)",
      {"proxy",
       {"triangles", kGrouped},
       {"vertices", kGrouped},
       {"kB", kKilobytes},
       {"texture", 0, "", "px"}});
  for (const double px : m.proxy_sizes_px) table.column({"FLIP at " + *pixels(px).shown, shortest_form(3)});
  for (std::size_t k = 0; k < m.proxies.size(); ++k) {
    const ManifestProxy& p = m.proxies[k];
    table.row(
        {k, p.triangles, p.vertices, p.glb.bytes, p.texture_px > 0 ? Cell(p.texture_px) : Cell("none")});
    for (const double flip : p.flip) table.rows.back().emplace_back(flip);
  }
  return table.text() + "\n";
}

Json proxies_json(const Manifest& m) {
  Json list = Json::array();
  for (const ManifestProxy& p : m.proxies) {
    Json losses = Json::array();
    for (std::size_t k = 0; k < p.flip.size(); ++k)
      losses.push_back(
          {{"display_px", m.proxy_sizes_px[k]}, {"flip", p.flip[k]}, {"flip_p95", p.flip_p95[k]}});
    list.push_back({{"path", p.glb.path},
                    {"bytes", p.glb.bytes},
                    {"triangles", p.triangles},
                    {"vertices", p.vertices},
                    {"texture_px", p.texture_px},
                    {"losses", losses}});
  }
  return list;
}

/// What a client's first request brings.
std::string start_text(const Manifest& m) {
  const bool fits = start_bytes(m) <= kStartBytes;
  return fmt::format("start     {} bytes from byte 0 show the object ({}): {} of 44 KiB {}\n\n",
                     grouped(start_bytes(m)), first_picture(m).path, fits ? "one request" : "a first request",
                     fits ? "does" : "does not");
}

std::string options_text(const Provenance& provenance) {
  Table table("options that differ from this version's defaults (all of them: dump PKG provenance)",
              {Column::text("option"), Column::text("value"), Column::text("default")});
  for (const OptionChange& c : changed_options(*provenance.options)) table.row({c.name, c.value, c.fallback});
  return table.rows.empty() ? "options: all at their defaults\n" : table.text();
}

/// The first lines: what the object is and what may be done with it.
std::string about_head(const About& about) {
  std::string s = about.title.empty() ? std::string() : printable(about.title) + "\n";
  const auto add = [&s](const char* name, const std::string& text) {
    if (!text.empty()) s += fmt::format("{:<10}{}\n", name, printable(text));
  };
  add("by", about.attribution.empty() ? about.creator : about.attribution);
  add("licence", about.licence.empty() ? "not given" : about.licence);
  for (const NamedText& line : about_lines(about))
    if (line.name == "coordinate reference") add("crs", line.text);
  const std::string up = about.up_axis.empty() ? "up axis not known" : about.up_axis + " is up";
  add("unit", about.metres_per_unit > 0
                  ? fmt::format("{}, {} m; {}", about.unit, shortest(about.metres_per_unit, 7), up)
                  : "not known; " + up);
  return s;
}

std::vector<KindBytes> kinds_of(PackageReader& p) {
  return bytes_by_kind(p.manifest(), p.store().read_manifest().size(), p.index());
}

std::uint64_t sum_of(const std::vector<KindBytes>& kinds) {
  std::uint64_t sum = 0;
  for (const KindBytes& k : kinds) sum += k.bytes;
  return sum;
}

}  // namespace

std::string scales_text(PackageReader& p, DumpGamma) {
  std::string floors;
  for (const ManifestScale& s : p.manifest().scales)
    if (!s.floor.empty()) floors += fmt::format("S_{} is no coarser: {}\n", s.scale, printable(s.floor));
  return scales_table(p.manifest()).text() + floors;
}

Json scales_json(PackageReader& p, DumpGamma) { return {{"scales", scales_table(p.manifest()).json()}}; }

std::string summary_text(PackageReader& p, DumpGamma) {
  const Manifest& m = p.manifest();
  const Provenance provenance = read_provenance(p.entry(m.provenance));
  const std::vector<KindBytes> kinds = kinds_of(p);
  Table bytes = kinds_table(kinds, sum_of(kinds));
  bytes.row({"all", p.index().size() + 2, sum_of(kinds), 1.0});
  std::string s = about_head(p.about());
  s += fmt::format("package   {}\nformat    {}.{}, made by {}\n", to_hex(p.id()), m.major, m.minor,
                   printable(provenance.tool));
  s += fmt::format("origin    {}\nbounds    {}\n       to {}\nsize      {}   object units\n",
                   vector_text(m.origin), vector_text(m.bounds_min), vector_text(m.bounds_max),
                   vector_text(m.bounds_max - m.bounds_min));
  if (m.poster)
    s += fmt::format("poster    {} x {} px, {} kB\n", m.poster->width_px, m.poster->height_px,
                     kilobytes(m.poster->bytes));
  const std::string stream =
      m.stream ? stream_table(p.split_stream_head()).text() : "vertex-split stream: none\n";
  const std::string textures = p.textures().empty() ? "textures: none\n" : textures_table(p).text();
  return s + start_text(m) + scales_text(p, {}) + "\n" + proxies_text(m) + stream + "\n" + steps_text(m) +
         "\n" + textures + "\n" + bytes.text() + "\n" + options_text(provenance);
}

Json summary_json(PackageReader& p, DumpGamma) {
  const Manifest& m = p.manifest();
  const std::vector<KindBytes> kinds = kinds_of(p);
  const auto rule = [&](StepRule r) { return steps_table(step_function(m.scales, r)).json(); };
  const PosterRef poster = m.poster.value_or(PosterRef{});
  const Json picture{{"width_px", poster.width_px}, {"height_px", poster.height_px}, {"bytes", poster.bytes}};
  return {
      {"package",
       {{"id", to_hex(p.id())},
        {"version", {{"major", m.major}, {"minor", m.minor}}},
        {"title", m.title},
        {"tool", read_provenance(p.entry(m.provenance)).tool},
        {"entries", p.index().size() + 2},
        {"entry_bytes", sum_of(kinds)}}},
      {"object",
       {{"origin", vector_json(m.origin)},
        {"bounds_min", vector_json(m.bounds_min)},
        {"bounds_max", vector_json(m.bounds_max)},
        {"height", m.object_height},
        {"surface_area", m.surface_area},
        {"jnd", m.jnd}}},
      {"steps", steps_table(m.steps).json()},
      {"step_rules",
       {{"jnd", rule(StepRule::kJnd)}, {"error", rule(StepRule::kError)}, {"edge", rule(StepRule::kEdge)}}},
      {"camera", {{"fov_degrees", Camera{}.fov_degrees}, {"viewport_px", Camera{}.viewport_px}}},
      {"stream", m.stream ? stream_table(p.split_stream_head()).json() : Json::array()},
      {"proxies", proxies_json(m)},
      {"poster", m.poster ? picture : Json()},
      {"textures", textures_table(p).json()},
      {"bytes", kinds_table(kinds, sum_of(kinds)).json()},
      {"start",
       {{"bytes", start_bytes(m)},
        {"shows", first_picture(m).path},
        {"in_one_request", start_bytes(m) <= kStartBytes}}}};
}

}  // namespace texmesh
