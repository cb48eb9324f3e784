// The parts of a dump as text and as JSON; those of textures stand in dump_textures.cpp. What both show
// stands in one Table. The summary is the page to read first: what the object is, what a client's first
// request brings, scales, proxies, the step function, textures, bytes by kind, and the options that differ
// from the defaults.
#include "tools/inspect/dump/dump.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "format/rules/jnd_choice.h"
#include "format/rules/viewing.h"
#include "pipeline/io/table.h"
#include "tools/inspect/atlas/atlas_report.h"
#include "tools/inspect/provenance.h"

namespace texmesh {

template <>
struct RecordFields<ManifestScale> {
  static void fields(auto& s, auto&& v) {
    constexpr Range kCount{1, 9007199254740992.0}, kError{0, 1e300}, kHeight{0, 1e9};
    v("scale", s.scale, Range{0, 99}, "");
    v("triangles", s.triangles, kCount, "");
    v("vertices", s.vertices, kCount, "");
    v("bytes", s.glb.bytes, kCount, "");
    v("major", s.major, "");
    v("error_max", s.error_max, kError, "");
    v("error_rms", s.error_rms, kError, "");
    v("p95", s.p95, kError, "");
    v("p99", s.p99, kError, "");
    v("display_px_flip", s.display_px_flip, kHeight, "");
    v("display_px_jnd", s.display_px_jnd, kHeight, "");
    v("display_px_error", s.display_px_error, kHeight, "");
    v("display_px_edge", s.display_px_edge, kHeight, "");
    v("floor", s.floor, "why no coarser scale is kept; empty = one is");
    v("path", s.glb.path, FieldRule{.pattern = "^mesh/(s[0-9]{2}\\.glb|stream\\.bin)$"}, "");
  }
};

namespace {

struct DumpedScales {
  std::vector<ManifestScale> scales;
  static void fields(auto& s, auto&& v) {
    v("scales", s.scales, FieldRule{.count = Range{1, 100}}, "S_0 first");
  }
};

struct Kind {
  const char* name;
  std::vector<EntryKind> kinds;
};

const std::array<Kind, 12>& kinds() {
  static const std::array<Kind, 12> list{
      {{"manifest and index", {EntryKind::kManifest, EntryKind::kIndex}},
       {"tables", {EntryKind::kTables, EntryKind::kTextures, EntryKind::kQuality}},
       {"meshes", {EntryKind::kMesh}},
       {"proxies", {EntryKind::kProxy}},
       {"vertex-split stream", {EntryKind::kSplitStream}},
       {"previews", {EntryKind::kPreview}},
       {"poster", {EntryKind::kPoster}},
       {"textures", {EntryKind::kTableStreams, EntryKind::kRung}},
       {"source images", {EntryKind::kSource}},
       {"the thesis's tables", {EntryKind::kThesis}},
       {"for viewers of glTF", {EntryKind::kGltfIndex, EntryKind::kGltfScale, EntryKind::kGltfImage}},
       {"about, provenance and others",
        {EntryKind::kAbout, EntryKind::kAnnotations, EntryKind::kProvenance, EntryKind::kOther,
         EntryKind::kContentCredential}}}};
  return list;
}

/// A scale of the vertex-split stream: its counts, and the bytes from the stream's start to it.
struct StreamFigures {
  int scale = 0;
  std::uint32_t points = 0, triangles = 0, blocks = 0;
  std::uint64_t bytes = 0;  // all of: head, connectivity, positions, texture coordinates, others
  std::uint64_t connectivity = 0, positions = 0, uv = 0, others = 0;
};
std::vector<StreamFigures> stream_figures(const SplitStreamHead& head) {
  std::vector<StreamFigures> scales;
  StreamFigures sum;
  sum.bytes = head.bytes;
  for (const SplitScale& s : head.scales) {
    for (; sum.blocks < s.blocks; ++sum.blocks) {
      const SplitBlock& b = head.blocks[sum.blocks];
      sum.bytes += b.bytes();
      sum.connectivity += b.parts[0];
      sum.positions += b.parts[1];
      for (std::size_t k = 0; k < head.attributes.size(); ++k)
        (head.attributes[k].kind <= SplitKind::kUv1 ? sum.uv : sum.others) += b.parts[k + 2];
    }
    sum.scale = s.scale, sum.points = s.points, sum.triangles = s.triangles;
    scales.push_back(sum);
  }
  return scales;
}

std::string vector_text(const Vec3d& v) {
  const auto text = [](double x) { return shortest(x + 0.0, 7); };  // no -0
  return fmt::format("{}  {}  {}", text(v.x), text(v.y), text(v.z));
}

std::array<double, 3> numbers(const Vec3d& v) { return {v.x, v.y, v.z}; }

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
      {{"scale", kScaleName},
       {"triangles", kGrouped},
       {"vertices", kGrouped},
       {"kB", kKilobytes},
       "from",
       "major",
       {"max error", kShortest},
       {"rms error", kShortest},
       {"p95", percent_form(2), "", "%"},
       {"p99", percent_form(2), "", "%"},
       {"flip", {}, "", "px"},
       {"jnd", {}, "", "px"},
       {"error", {}, "", "px"},
       {"edge", {}, "", "px"}});
  for (const ManifestScale& s : m.scales)
    table.row({s.scale, s.triangles, s.vertices, s.glb.bytes, s.has_glb() ? "file" : "stream", s.major,
               s.error_max, s.error_rms, s.p95, s.p99, pixels(s.display_px_flip), pixels(s.display_px_jnd),
               pixels(s.display_px_error), pixels(s.display_px_edge)});
  return table;
}

/// What the first page says of scales.
Table few_columns_of_scales(const Manifest& m) {
  Table table(
      "scales (flip [px] = displayed height up to which nobody tells the scale from S_0 in lit pictures)",
      {{"scale", kScaleName},
       {"triangles", kGrouped},
       {"kB", kKilobytes},
       {"max error", kShortest},
       {"flip", {}, "", "px"}});
  for (const ManifestScale& s : m.scales)
    table.row({s.scale, s.triangles, s.glb.bytes, s.error_max, pixels(s.display_px_flip)});
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
                                                     rule(StepRule::kEdge), rule(StepRule::kDistance)};
  Table table(
      fmt::format(
          "step function: displayed height in px up to which a scale is shown, and the distance in object "
          "heights from\nwhich on that is (field of view {:.0f} degrees, {:.0f} px high); the package's own "
          "(by lit pictures), then\nby single rules",
          Camera{}.fov_degrees, Camera{}.viewport_px),
      {{"show", kScaleName}});
  for (const char* name : {"px", "JND px", "1 px error px", "O_V/E_S px", "7.5 px"}) {
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
               fmt::format("{}x{}", t.columns, t.rows), p.tables().planes[k].order.size(), t.rungs.size(),
               t.rungs.empty() ? Cell() : t.rungs.front().bytes,
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
  Table table("proxies (whole objects in small files; mean FLIP of lit pictures at displayed heights in px)",
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
  return bytes_by_kind(p.manifest(), p.store().read_manifest().size(), p.entries());
}

std::uint64_t bytes_of_kinds(const std::vector<KindBytes>& kinds) {
  std::uint64_t sum = 0;
  for (const KindBytes& k : kinds) sum += k.bytes;
  return sum;
}

std::string floors_text(const Manifest& m) {
  std::string out;
  for (const ManifestScale& s : m.scales)
    if (!s.floor.empty()) out += fmt::format("S_{} is no coarser: {}\n", s.scale, printable(s.floor));
  return out;
}

std::string scales_text(PackageReader& p, DumpGamma) {
  const Manifest& m = p.manifest();
  const std::string stream =
      m.stream ? stream_table(p.split_stream_head()).text() : "vertex-split stream: none\n";
  return scales_table(m).text() + floors_text(m) + "\n" + stream + "\n" + steps_text(m);
}

std::string summary_text(PackageReader& p, DumpGamma) {
  const Manifest& m = p.manifest();
  const Provenance provenance = read_provenance(p.entry(m.provenance));
  const std::vector<KindBytes> kinds = kinds_of(p);
  Table bytes = kinds_table(kinds, bytes_of_kinds(kinds));
  bytes.row({"all", p.entries().size() + 2, bytes_of_kinds(kinds), 1.0});
  std::string s = about_head(p.about());
  s += fmt::format("package   {}\nformat    {}.{}, made by {}\n", to_hex(p.id()), m.major, m.minor,
                   printable(provenance.tool));
  s += fmt::format("origin    {}\nbounds    {}\n       to {}\nsize      {}   {}\n", vector_text(m.origin),
                   vector_text(m.bounds_min), vector_text(m.bounds_max),
                   vector_text(m.bounds_max - m.bounds_min),
                   p.about().metres_per_unit > 0 ? printable(p.about().unit) : "object units");
  if (m.poster)
    s += fmt::format("poster    {} x {} px, {} kB\n", m.poster->width_px, m.poster->height_px,
                     kilobytes(m.poster->bytes));
  if (m.annotations) s += fmt::format("notes     {}\n", notes_words(count_notes(p.annotations(), m)));
  const std::string textures = p.textures().empty() ? "textures: none\n" : textures_table(p).text();
  return s + start_text(m) + few_columns_of_scales(m).text() + floors_text(m) +
         "dump PKG scales tells more of them\n\n" + proxies_text(m) + textures + "\n" + bytes.text() + "\n" +
         options_text(provenance);
}

Json summary_json(PackageReader& p, DumpGamma) {
  const Manifest& m = p.manifest();
  const std::vector<KindBytes> kinds = kinds_of(p);
  const auto rule = [&](StepRule r) { return steps_table(step_function(m.scales, r)).json(); };
  Json proxies = Json::array();
  for (const ManifestProxy& x : m.proxies) {
    proxies.push_back({{"path", x.glb.path},
                       {"bytes", x.glb.bytes},
                       {"triangles", x.triangles},
                       {"vertices", x.vertices},
                       {"texture_px", x.texture_px},
                       {"losses", Json::array()}});
    for (std::size_t k = 0; k < x.flip.size(); ++k)
      proxies.back()["losses"].push_back(
          {{"display_px", m.proxy_sizes_px[k]}, {"flip", x.flip[k]}, {"flip_p95", x.flip_p95[k]}});
  }
  const PosterRef poster = m.poster.value_or(PosterRef{});
  const Json picture{{"width_px", poster.width_px}, {"height_px", poster.height_px}, {"bytes", poster.bytes}};
  return {{"package",
           {{"id", to_hex(p.id())},
            {"version", {{"major", m.major}, {"minor", m.minor}}},
            {"title", m.title},
            {"tool", read_provenance(p.entry(m.provenance)).tool},
            {"entries", p.entries().size() + 2},
            {"entry_bytes", bytes_of_kinds(kinds)}}},
          {"object",
           {{"origin", numbers(m.origin)},
            {"bounds_min", numbers(m.bounds_min)},
            {"bounds_max", numbers(m.bounds_max)},
            {"height", m.object_height},
            {"surface_area", m.surface_area},
            {"jnd", m.jnd}}},
          {"steps", steps_table(m.steps).json()},
          {"step_rules",
           {{"jnd", rule(StepRule::kJnd)},
            {"error", rule(StepRule::kError)},
            {"edge", rule(StepRule::kEdge)},
            {"distance", rule(StepRule::kDistance)}}},
          {"camera", {{"fov_degrees", Camera{}.fov_degrees}, {"viewport_px", Camera{}.viewport_px}}},
          {"stream", m.stream ? stream_table(p.split_stream_head()).json() : Json::array()},
          {"proxies", proxies},
          {"poster", m.poster ? picture : Json()},
          {"textures", textures_table(p).json()},
          {"bytes", kinds_table(kinds, bytes_of_kinds(kinds)).json()},
          {"start",
           {{"bytes", start_bytes(m)},
            {"shows", first_picture(m).path},
            {"in_one_request", start_bytes(m) <= kStartBytes}}}};
}

/// A way to compare scales, and its values for all pairs.
struct Comparison {
  std::string name;
  std::vector<float> value;
};

std::vector<Comparison> comparisons_of(const PerceptualTable& t) {
  std::vector<Comparison> out{{"p95", pair_values(t, PerceptualStatistic::kP95)}};
  for (const PerceptualStatistic s : {PerceptualStatistic::kAverage, PerceptualStatistic::kConservative,
                                      PerceptualStatistic::kAggressive}) {
    out.push_back({std::string(enum_name(s)), pair_values(t, s)});
    out.push_back({std::string(enum_name(s)) + ", survivor", pair_values(t, s, ChainRule::kSurvivor)});
  }
  return out;
}

std::vector<int> majors_of(const PerceptualTable& t, const Comparison& c, double jnd) {
  std::vector<int> out;
  const std::vector<std::uint8_t> major = major_rows(c.value, t.scale.size(), jnd);
  for (std::size_t k = 0; k < major.size(); ++k)
    if (major[k]) out.push_back(t.scale[k]);
  return out;
}

/// Every step from scale to scale. The first row, S_0, follows no other.
Table table_7_1(const PerceptualTable& t) {
  Table table("change of the distance to the skeleton from scale to scale, over collapses (Table 7.1)",
              {{"scales", 0, "scale"},
               {"triangles", kGrouped, "triangles"},
               {"collapses", kGrouped, "collapses"},
               {"average", 4, "average"},
               {"deviation", 4, "deviation"},
               {"largest", 4, "largest"},
               {"least", 4, "least"}});
  for (std::size_t k = 0; k < t.scale.size(); ++k)
    table.row({{t.scale[k], fmt::format("{}-{}", t.scale[k > 0 ? k - 1 : 0], t.scale[k])},
               t.triangles[k],
               t.collapses[k],
               t.average[k],
               t.deviation[k],
               t.largest[k],
               t.least[k]});
  return table;
}

Table table_7_2(const PerceptualTable& t, const std::vector<Comparison>& comparisons) {
  Table table(
      "cumulative values from S_0 (Table 7.2); of collapses: the root of the sum of squares, and against\n"
      "the vertex that is left (survivor); --json has all pairs",
      {"from", "to"});
  for (const Comparison& c : comparisons) table.column({c.name, 4});
  for (std::size_t j = 1; j < t.scale.size(); ++j) {
    table.row({0, t.scale[j]});
    for (const Comparison& c : comparisons) table.rows.back().emplace_back(c.value[j]);
  }
  return table;
}

Table pairs_of(const PerceptualTable& t, const Comparison& c) {
  Table table(c.name, {{"from", 0, "from"}, {"to", 0, "to"}, {"value", 4, "value"}});
  const std::size_t rows = t.scale.size();
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = i + 1; j < rows; ++j) table.row({t.scale[i], t.scale[j], c.value[i * rows + j]});
  return table;
}

std::string perceptual_text(PackageReader& package, DumpGamma) {
  const PerceptualTable* t = package.perceptual_table();
  if (!t || t->scale.size() < 2) return "no perceptual table\n";
  const std::vector<Comparison> comparisons = comparisons_of(*t);
  const double jnd = package.manifest().jnd;
  Table steps = table_7_1(*t);
  steps.rows.erase(steps.rows.begin());
  Table majors("major scales at JND " + shortest(jnd), {Column::text("by"), Column::text("major scales")});
  for (const Comparison& c : comparisons)
    majors.row({c.name, fmt::format("{}", fmt::join(majors_of(*t, c, jnd), " "))});
  return steps.text() + "\n" + table_7_2(*t, comparisons).text() + "\n" + majors.text();
}

Json perceptual_json(PackageReader& package, DumpGamma) {
  const PerceptualTable* t = package.perceptual_table();
  if (!t) return {{"perceptual", nullptr}};
  const double jnd = package.manifest().jnd;
  Json values = Json::array();
  for (const Comparison& c : comparisons_of(*t))
    values.push_back({{"by", c.name}, {"major", majors_of(*t, c, jnd)}, {"pairs", pairs_of(*t, c).json()}});
  return {{"perceptual", {{"jnd", jnd}, {"steps", table_7_1(*t).json()}, {"values", values}}}};
}

Table entries_table(PackageReader& p) {
  Table table("", {{"offset", 0, "offset"},
                   {"bytes", 0, "bytes"},
                   Column::text("sha256", "sha256"),
                   Column::text("path", "path")});
  for (const ContainerEntry& e : p.store().list())
    if (e.path == kManifestPath) table.row({e.offset, e.bytes, to_hex(p.id()), e.path});
  std::vector<EntryRef> entries = p.entries();
  const EntryRef& index = p.manifest().index;
  entries.insert(std::ranges::upper_bound(entries, index.offset, {}, &EntryRef::offset), index);
  for (const EntryRef& e : entries) table.row({e.offset, e.bytes, to_hex(e.digest), e.path});
  return table;
}

std::string provenance_text(PackageReader& p, DumpGamma) {
  const Provenance provenance = read_provenance(p.entry(p.manifest().provenance));
  Table inputs("inputs",
               {Column::text("role"), {"bytes", kGrouped}, Column::text("sha256"), Column::text("uri")});
  for (const auto& i : provenance.inputs) inputs.row({i.role, i.bytes, i.sha256, i.uri});
  Table options("options", {Column::text("option"), Column::text("value")});
  for (const auto& [stage, section] : provenance.options->items())
    if (section.is_object())
      for (const auto& [name, value] : section.items()) options.row({stage + "." + name, value.dump()});
  Table versions("versions", {Column::text("stage or library"), "version"});
  for (const auto& [name, version] : provenance.stages) versions.row({name, version});
  for (const auto& [name, version] : provenance.libraries) versions.row({name, version});
  return fmt::format("made by   {}, format {}\n\n", printable(provenance.tool), provenance.format.text()) +
         inputs.text() + "\n" + options.text() + "\n" + versions.text();
}

/// A document as it stands in the package; `read` refuses what verify would refuse.
template <class Read>
Bytes checked(PackageReader& p, const EntryRef& entry, Read read) {
  Bytes bytes = p.entry(entry);
  read(bytes);
  return bytes;
}

/// What the source said is JSON of strangers: escaped, so that a terminal sees no control characters.
std::string verbatim_text(const char* title, const std::string& json) {
  if (json.empty()) return "";
  return fmt::format("\n{}\n{}\n", title,
                     Json::parse(json).dump(1, ' ', true, Json::error_handler_t::replace));
}

std::string about_text(PackageReader& p, DumpGamma) {
  const About& about = p.about();
  Table table("", {Column::text("about"), Column::text("")});
  for (const NamedText& line : about_lines(about)) table.row({line.name, line.text});
  return (table.rows.empty() ? "about: nothing is known\n" : table.text()) +
         verbatim_text("what the publisher added", about.extras) +
         verbatim_text("what the source said", about.source);
}

std::string annotations_text(PackageReader& p, DumpGamma) {
  const std::vector<Annotation>& list = p.annotations().list;
  if (list.empty()) return "notes: none\n";
  Table table("notes", {"note", Column::text("position"), Column::text("camera"), "images",
                        Column::text("languages"), Column::text("title")});
  for (std::size_t i = 0; i < list.size(); ++i) {
    std::string languages;
    for (const AnnotationText& t : list[i].texts) languages += (languages.empty() ? "" : ", ") + t.language;
    table.row({i + 1, vector_text(list[i].position), list[i].camera ? "yes" : "no", list[i].images.size(),
               languages, list[i].texts.front().title});
  }
  return table.text();
}

AtlasDiagnosis atlas_of(PackageReader& p) { return diagnose_atlases(atlas_subject(p, {}), {}); }

struct PartWriters {
  std::string (*text)(PackageReader&, DumpGamma);
  Json (*json)(PackageReader&, DumpGamma);
};
/// In the order of DumpPart.
constexpr PartWriters kWriters[] = {
    {summary_text, summary_json},
    {scales_text, [](PackageReader& p, DumpGamma) { return to_json(DumpedScales{p.manifest().scales}); }},
    {fragments_text, fragments_json},
    {ladder_text, ladder_json},
    {tables_text, tables_json},
    {perceptual_text, perceptual_json},
    {[](PackageReader& p, DumpGamma) { return atlas_text(atlas_of(p)); },
     [](PackageReader& p, DumpGamma) {
       return Json{{"atlas", to_json(atlas_of(p))}};
     }},
    {[](PackageReader& p, DumpGamma) { return entries_table(p).text(""); },
     [](PackageReader& p, DumpGamma) {
       return Json{{"entries", entries_table(p).json()}};
     }},
    {about_text,
     [](PackageReader& p, DumpGamma) {
       return Json{{"about", Json::parse(checked(p, p.manifest().about, read_about))}};
     }},
    {annotations_text,
     [](PackageReader& p, DumpGamma) {
       const Annotations& all = p.annotations();
       return all.list.empty() ? Json::object() : annotations_json(all);
     }},
    {provenance_text, [](PackageReader& p, DumpGamma) {
       return Json{{"provenance", Json::parse(checked(p, p.manifest().provenance, read_provenance))}};
     }}};

}  // namespace

std::vector<KindBytes> bytes_by_kind(const Manifest& manifest, std::uint64_t manifest_bytes,
                                     const std::vector<EntryRef>& index) {
  std::vector<KindBytes> sums;
  for (const Kind& kind : kinds()) sums.push_back({kind.name, 0, 0});
  const auto add = [&](const std::string& path, std::uint64_t bytes) {
    const EntryKind found = parse_entry_path(path).kind;
    for (std::size_t k = 0; k < sums.size(); ++k) {
      const auto& members = kinds()[k].kinds;
      if (std::find(members.begin(), members.end(), found) == members.end()) continue;
      ++sums[k].entries;
      sums[k].bytes += bytes;
    }
  };
  add(kManifestPath, manifest_bytes);
  add(kIndexPath, manifest.index.bytes);
  for (const EntryRef& e : index) add(e.path, e.bytes);
  std::erase_if(sums, [](const KindBytes& k) { return k.entries == 0; });
  return sums;
}

std::string dump_text(PackageReader& package, DumpPart part, DumpGamma gamma) {
  if (part != DumpPart::kAll) return kWriters[static_cast<std::size_t>(part)].text(package, gamma);
  std::string s;
  for (std::size_t k = 0; k < std::size(kWriters); ++k) {
    if (k == static_cast<std::size_t>(DumpPart::kScales)) continue;  // stands in the summary
    s += (k ? "\n== " + std::string(EnumNames<DumpPart>::names[k]) + "\n" : "") +
         kWriters[k].text(package, gamma);
  }
  return s;
}

Json dump_json(PackageReader& package, DumpPart part, DumpGamma gamma) {
  if (part != DumpPart::kAll) return kWriters[static_cast<std::size_t>(part)].json(package, gamma);
  Json all = Json::object();
  for (const PartWriters& writers : kWriters) all.update(writers.json(package, gamma));
  return all;
}

DocumentSchema dump_scales_schema() {
  return document_schema("dump-scales.v1", "texmesh dump scales, version 1",
                         "Output of `texmesh dump PKG scales --json`.", schema_of<DumpedScales>());
}

}  // namespace texmesh
