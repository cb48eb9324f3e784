#include "tools/inspect/dump/dump_summary.h"

#include <fmt/format.h>

#include <algorithm>

#include "format/rules/viewing.h"
#include "pipeline/io/text_table.h"
#include "tools/inspect/dump/dump_cells.h"
#include "tools/inspect/dump/option_changes.h"
#include "tools/inspect/dump/package_figures.h"
#include "tools/inspect/provenance.h"

namespace texmesh {
namespace {

std::string vector_text(const Vec3d& v) {
  return fmt::format("{}  {}  {}", shortest(v.x, 7), shortest(v.y, 7), shortest(v.z, 7));
}

/// Displayed sizes: whole pixels below 100000, "any" for what is enough at any size.
std::string pixels(double px) {
  return px >= kAnyDisplayPx ? "any" : grouped(static_cast<std::uint64_t>(px + 0.5));
}

std::string stream_text(PackageReader& p) {
  if (!p.manifest().stream) return "vertex-split stream: none\n";
  const SplitStreamHead head = p.split_stream_head();
  TextTable table;
  for (const char* header :
       {"up to", "triangles", "points", "blocks", "kB", "connectivity", "positions", "UV", "others"})
    table.column(header);
  for (const StreamFigures& f : stream_figures(head))
    table.row({fmt::format("S_{}", f.scale), grouped(f.triangles), grouped(f.points), grouped(f.blocks),
               kilobytes(f.bytes), kilobytes(f.connectivity), kilobytes(f.positions), kilobytes(f.uv),
               kilobytes(f.others)});
  return fmt::format("vertex-split stream ({} bits per coordinate; kB from its start, head included)\n",
                     head.position.bits) +
         table.text();
}

/// "up to 1 234" of the rule's step to this scale, "" where it has none; and the least distance that is.
void add_step_cells(const std::vector<ManifestStep>& steps, int scale, std::vector<std::string>& cells) {
  const auto step =
      std::find_if(steps.begin(), steps.end(), [scale](const ManifestStep& s) { return s.scale == scale; });
  if (step == steps.end()) {
    cells.insert(cells.end(), {"", ""});
    return;
  }
  cells.push_back(pixels(step->up_to_px));
  cells.push_back(step->up_to_px >= kAnyDisplayPx ? "any"
                                                  : shortest(viewing_distance(1, step->up_to_px, {}), 3));
}

std::string steps_text(const Manifest& m) {
  const auto rule = [&](StepRule r) { return step_function(m.scales, r); };
  const std::vector<std::vector<ManifestStep>> rules{m.steps, rule(StepRule::kJnd), rule(StepRule::kError),
                                                     rule(StepRule::kEdge)};
  TextTable table;
  table.column("show");
  for (const char* name : {"px", "JND px", "1 px error px", "O_V/E_S px"}) {
    table.column(name);
    table.column("distance");
  }
  for (auto s = m.scales.rbegin(); s != m.scales.rend(); ++s) {
    std::vector<std::string> cells{fmt::format("S_{}", s->scale)};
    for (const auto& steps : rules) add_step_cells(steps, s->scale, cells);
    table.row(cells);
  }
  return fmt::format(
             "step function: displayed height in px up to which a scale is shown, and the distance in object "
             "heights from\nwhich on that is (field of view {:.0f} degrees, {:.0f} px high); the package's "
             "own (by lit pictures), then\nby single rules\n",
             Camera{}.fov_degrees, Camera{}.viewport_px) +
         table.text();
}

std::string textures_text(PackageReader& p) {
  if (p.textures().empty()) return "textures: none\n";
  TextTable table;
  for (const char* header : {"plane", "image", "mip"}) table.column(header);
  table.column("role", Align::kLeft);
  table.column("name", Align::kLeft);
  for (const char* header :
       {"width px", "height px", "grid", "stored", "rungs", "lowest kB", "highest kB", "all kB"})
    table.column(header);
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const TextureInfo& t = p.textures()[k];
    std::uint64_t all = t.tables.bytes;
    for (const EntryRef& rung : t.rungs) all += rung.bytes;
    table.row({std::to_string(k), std::to_string(t.image), std::to_string(t.mip), t.role, printable(t.name),
               std::to_string(t.width_px), std::to_string(t.height_px),
               fmt::format("{}x{}", t.columns, t.rows),
               std::to_string(stored_fragments(p.tables().planes[k])), std::to_string(t.rungs.size()),
               t.rungs.empty() ? "" : kilobytes(t.rungs.front().bytes),
               t.rungs.empty() ? "" : kilobytes(t.rungs.back().bytes), kilobytes(all)});
  }
  return "textures (mip m has 1 / 2^m of the sides; grid and stored count fragments; kB of the lowest and "
         "the\n"
         "highest rung, and of all)\n" +
         table.text();
}

std::string kinds_text(const std::vector<KindBytes>& kinds) {
  TextTable table;
  table.column("bytes by kind", Align::kLeft);
  for (const char* header : {"entries", "kB", "%"}) table.column(header);
  std::uint64_t sum = 0, entries = 0;
  for (const KindBytes& k : kinds) sum += k.bytes, entries += k.entries;
  for (const KindBytes& k : kinds)
    table.row({k.kind, grouped(k.entries), kilobytes(k.bytes),
               percent(static_cast<double>(k.bytes) / static_cast<double>(sum))});
  table.row({"all", grouped(entries), kilobytes(sum), "100.0"});
  return table.text();
}

/// Nothing for a package without proxies.
std::string proxies_text(const Manifest& m) {
  if (m.proxies.empty()) return "";
  TextTable table;
  for (const char* header : {"proxy", "triangles", "vertices", "kB", "texture [px]"}) table.column(header);
  for (const double px : m.proxy_sizes_px) table.column("FLIP at " + pixels(px));
  for (std::size_t k = 0; k < m.proxies.size(); ++k) {
    const ManifestProxy& p = m.proxies[k];
    std::vector<std::string> row{std::to_string(k), grouped(p.triangles), grouped(p.vertices),
                                 kilobytes(p.glb.bytes),
                                 p.texture_px > 0 ? std::to_string(p.texture_px) : "none"};
    for (const double flip : p.flip) row.push_back(shortest(flip, 3));
    table.row(std::move(row));
  }
  return "proxies (whole objects with an atlas of their own; mean FLIP of lit pictures at displayed heights in "
         "px)\n" +
         table.text() + "\n";
}

/// What a client's first request brings.
std::string start_text(const Manifest& m) {
  const bool fits = start_bytes(m) <= kStartBytes;
  return fmt::format("start     {} bytes from byte 0 show the object ({}): {} of 44 KiB {}\n\n",
                     grouped(start_bytes(m)), first_picture(m).path, fits ? "one request" : "a first request",
                     fits ? "does" : "does not");
}

std::string options_text(const Provenance& provenance) {
  const std::vector<OptionChange> changes = changed_options(*provenance.options);
  if (changes.empty()) return "options: all at their defaults\n";
  TextTable table;
  table.column("option", Align::kLeft);
  table.column("value", Align::kLeft);
  table.column("default", Align::kLeft);
  for (const OptionChange& c : changes) table.row({printable(c.name), printable(c.value), c.fallback});
  return "options that differ from this version's defaults (all of them: dump PKG provenance)\n" +
         table.text();
}

}  // namespace

std::string scales_text(PackageReader& p) {
  TextTable table;
  for (const char* header :
       {"scale", "triangles", "vertices", "kB", "from", "major", "max error", "rms error", "p95 [%]",
        "p99 [%]", "flip [px]", "jnd [px]", "error [px]", "edge [px]"})
    table.column(header);
  std::string floors;
  for (const ManifestScale& s : p.manifest().scales)
    if (!s.floor.empty()) floors += fmt::format("S_{} is no coarser: {}\n", s.scale, printable(s.floor));
  for (const ManifestScale& s : p.manifest().scales)
    table.row({fmt::format("S_{}", s.scale), grouped(s.triangles), grouped(s.vertices),
               kilobytes(s.glb.bytes), s.has_glb() ? "file" : "stream", s.major ? "yes" : "",
               shortest(s.error_max), shortest(s.error_rms), percent(s.p95, 2), percent(s.p99, 2),
               pixels(s.display_px_flip), pixels(s.display_px_jnd), pixels(s.display_px_error),
               pixels(s.display_px_edge)});
  return "scales (errors in object units; px = displayed height up to which the scale is enough, by lit "
         "pictures, by the\n"
         "just-noticeable difference, by an error of one pixel, by its edges)\n" +
         table.text() + floors;
}

/// The first lines: what the object is and what may be done with it.
static std::string about_head(const About& about) {
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

std::string summary_text(PackageReader& p) {
  const Manifest& m = p.manifest();
  const Provenance provenance = read_provenance(p.entry(m.provenance));
  const auto kinds = bytes_by_kind(m, p.store().read_manifest().size(), p.index());
  const Vec3d size = m.bounds_max - m.bounds_min;
  std::string s = about_head(p.about());
  s += fmt::format("package   {}\nformat    {}.{}, made by {}\n", to_hex(p.id()), m.major, m.minor,
                   printable(provenance.tool));
  s += fmt::format("origin    {}\nbounds    {}\n       to {}\nsize      {}   object units\n",
                   vector_text(m.origin), vector_text(m.bounds_min), vector_text(m.bounds_max),
                   vector_text(size));
  if (m.poster)
    s += fmt::format("poster    {} x {} px, {} kB\n", m.poster->width_px, m.poster->height_px,
                     kilobytes(m.poster->bytes));
  return s + start_text(m) + scales_text(p) + "\n" + proxies_text(m) + stream_text(p) + "\n" + steps_text(m) +
         "\n" + textures_text(p) + "\n" + kinds_text(kinds) + "\n" + options_text(provenance);
}

}  // namespace texmesh
