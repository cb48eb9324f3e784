#include <fmt/format.h>

#include <algorithm>

#include "format/documents/allocation.h"
#include "format/documents/viewing.h"
#include "pipeline/inspect/dump/dump.h"
#include "pipeline/inspect/dump/option_changes.h"
#include "pipeline/inspect/dump/package_figures.h"
#include "pipeline/inspect/provenance.h"
#include "pipeline/io/text_table.h"

namespace texmesh {
namespace {

constexpr std::size_t kGammas = 21;

std::string kilobytes(std::uint64_t bytes) { return fixed(static_cast<double>(bytes) / 1e3, 1); }

std::string percent(double fraction, int digits = 1) { return fixed(100 * fraction, digits); }

std::string vector_text(const Vec3d& v) {
  return fmt::format("{}  {}  {}", shortest(v.x, 7), shortest(v.y, 7), shortest(v.z, 7));
}

/// Displayed sizes: whole pixels below 100000, "any" for what is enough at any size.
std::string pixels(double px) {
  return px >= kAnyDisplayPx ? "any" : grouped(static_cast<std::uint64_t>(px + 0.5));
}

std::string plane_title(const TextureInfo& t, std::size_t plane) {
  const std::string name = t.name.empty() ? "" : " \"" + printable(t.name) + "\"";
  const std::string mip = t.mip == 0 ? "" : fmt::format(", mip {} of plane {}", t.mip, t.base);
  return fmt::format("texture plane {}{}, {}{}: {} x {} px, {} channel{}\n", plane, name, t.role, mip,
                     t.width_px, t.height_px, t.channels, t.channels == 1 ? "" : "s");
}

std::string scales_text(PackageReader& p) {
  TextTable table;
  for (const char* header : {"scale", "triangles", "vertices", "kB", "major", "max error", "rms error",
                             "p95 [%]", "p99 [%]", "jnd [px]", "error [px]", "edge [px]"})
    table.column(header);
  std::string floors;
  for (const ManifestScale& s : p.manifest().scales)
    if (!s.floor.empty()) floors += fmt::format("S_{} is no coarser: {}\n", s.scale, printable(s.floor));
  for (const ManifestScale& s : p.manifest().scales)
    table.row({fmt::format("S_{}", s.scale), grouped(s.triangles), grouped(s.vertices),
               kilobytes(s.glb.bytes), s.major ? "yes" : "", shortest(s.error_max), shortest(s.error_rms),
               percent(s.p95, 2), percent(s.p99, 2), pixels(s.display_px_jnd), pixels(s.display_px_error),
               pixels(s.display_px_edge)});
  return "scales (errors in object units; px = displayed height up to which the scale is enough, by the "
         "just-noticeable\n"
         "difference, by an error of one pixel, by its edges)\n" +
         table.text() + floors;
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
             "own (finer of JND and 1 px error), then\nby single rules\n",
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

std::string options_text(const Provenance& provenance) {
  const std::vector<OptionChange> changes = changed_options(provenance.options);
  if (changes.empty()) return "options: all at their defaults\n";
  TextTable table;
  table.column("option", Align::kLeft);
  table.column("value", Align::kLeft);
  table.column("default", Align::kLeft);
  for (const OptionChange& c : changes) table.row({printable(c.name), printable(c.value), c.fallback});
  return "options that differ from this version's defaults (all of them: dump PKG provenance)\n" +
         table.text();
}

std::string summary_text(PackageReader& p) {
  const Manifest& m = p.manifest();
  const Provenance provenance = read_provenance(p.entry(m.provenance));
  const auto kinds = bytes_by_kind(m, p.store().read_manifest().size(), p.index());
  const Vec3d size = m.bounds_max - m.bounds_min;
  std::string s = m.title.empty() ? std::string() : printable(m.title) + "\n";
  s += fmt::format("package   {}\nformat    {}.{}, made by {}\n", to_hex(p.id()), m.major, m.minor,
                   printable(provenance.tool));
  s += fmt::format("origin    {}\nbounds    {}\n       to {}\nsize      {}   object units\n",
                   vector_text(m.origin), vector_text(m.bounds_min), vector_text(m.bounds_max),
                   vector_text(size));
  s += fmt::format(
      "start     {} kB show the object: manifest and index, then one range of {} bytes from {}\n\n",
      kilobytes(m.first_picture_offset + m.first_picture_bytes), m.first_picture_bytes,
      m.first_picture_offset);
  return s + scales_text(p) + "\n" + stream_text(p) + "\n" + steps_text(m) + "\n" + textures_text(p) + "\n" +
         kinds_text(kinds) + "\n" + options_text(provenance);
}

/// Where texture detail lies: a digit per fragment, eta of S_0 in tenths, '.' where nothing is stored.
std::string eta_map(const PlaneTables& t, const std::vector<float>& eta) {
  std::string map;
  for (std::size_t i = 0; i < t.fragment_count(); ++i) {
    const int tenth = std::clamp(static_cast<int>(10 * eta[i]), 0, 9);
    map += i % t.columns == 0 ? "  " : " ";
    map += t.covered_texels[i] == 0 ? '.' : static_cast<char>('0' + tenth);
    if (i % t.columns == t.columns - 1) map += '\n';
  }
  return map;
}

std::string fragments_text(PackageReader& p) {
  std::string s;
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const TextureInfo& info = p.textures()[k];
    const PlaneTables& t = p.tables().planes[k];
    const std::vector<float> eta = eta_of(t, 0);
    TextTable table;
    for (const char* header :
         {"rank", "fragment", "column", "row", "covered %", "surface %", "eta", "VQP", "q_0", "d_0 B"})
      table.column(header);
    const AllocationFigures finest = allocation_figures(t, 0);
    for (const int q : info.rung_quality) table.column(fmt::format("q{} B", q));
    const double texels = static_cast<double>(info.fragment_width_px) * info.fragment_height_px;
    for (std::size_t rank = 0; rank < t.order.size(); ++rank) {
      const std::size_t i = t.order[rank];
      std::vector<std::string> row{std::to_string(rank),
                                   std::to_string(i),
                                   std::to_string(i % t.columns),
                                   std::to_string(i / t.columns),
                                   percent(t.covered_texels[i] / texels),
                                   percent(static_cast<double>(t.surface_fraction[i]), 2),
                                   fixed(static_cast<double>(eta[i]), 3),
                                   fixed(static_cast<double>(t.vqp[i]), 3),
                                   fixed(static_cast<double>(finest.fragment_quality[i]), 1),
                                   std::to_string(finest.fragment_bytes[i])};
      for (std::size_t r = 0; r < t.rung_count(); ++r)
        row.push_back(std::to_string(t.size_bytes[r * t.fragment_count() + i]));
      table.row(std::move(row));
    }
    s += plane_title(info, k);
    s += "grid: " + printable(info.grid_reason) + "\neta of S_0 in tenths, . = not stored\n";
    s += eta_map(t, eta) +
         "fragments by falling importance; q_0, d_0: quality and bytes that the tables ask for at S_0\n" +
         table.text() + "\n";
  }
  return s.empty() ? "no textures\n" : s;
}

std::string ladder_text(PackageReader& p) {
  std::string s;
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    TextTable table;
    for (const char* header :
         {"rung", "quality", "kB", "tables B", "mean MSE", "mean SSIM", "surface SSIM", "bits/texel"})
      table.column(header);
    const PlaneTables& t = p.tables().planes[k];
    double texels = 0;
    for (const std::uint16_t i : t.order) texels += t.covered_texels[i];
    const auto figures = rung_figures(t);
    for (std::size_t r = 0; r < figures.size(); ++r)
      table.row({std::to_string(r), std::to_string(figures[r].quality), kilobytes(figures[r].bytes),
                 std::to_string(figures[r].table_bytes), fixed(figures[r].mse, 2), fixed(figures[r].ssim, 4),
                 fixed(figures[r].surface_ssim, 4),
                 texels > 0 ? fixed(8 * static_cast<double>(figures[r].bytes) / texels, 3) : ""});
    const TextureInfo& info = p.textures()[k];
    s += plane_title(info, k) + table.text();
    if (info.lossless) s += "  the last rung holds the source's coefficients: lossless\n";
    if (!info.source_extension.empty())
      s += fmt::format("  {}: the source as it was, {} B{}\n", info.source.path, info.source.bytes,
                       info.source_colours ? "" : ", whose colours were converted for this plane");
    s += fmt::format(
        "  preview {} x {} px, {} B; means over covered texels, surface SSIM over the object's surface\n\n",
        info.preview_width_px, info.preview_height_px, info.preview.bytes);
  }
  return s.empty() ? "no textures\n" : s;
}

std::string allocation_text(const PlaneTables& t, std::optional<double> gamma) {
  TextTable table;
  for (const char* header : {"scale", "Q_i", "Gamma", "q_i min", "mean", "max", "D_i kB", "Gamma 0 kB",
                             "0.25 kB", "0.5 kB", "0.75 kB", "1 kB"})
    table.column(header);
  for (std::uint32_t s = 0; s <= t.scales; ++s) {
    const AllocationFigures f = allocation_figures(t, s, gamma);
    std::vector<std::string> row{fmt::format("S_{}", s),   fixed(static_cast<double>(t.quality[s]), 1),
                                 fixed(f.gamma, 3),        fixed(f.quality_min, 1),
                                 fixed(f.quality_mean, 1), fixed(f.quality_max, 1),
                                 kilobytes(f.bytes)};
    for (std::size_t g = 0; g < kGammas; g += 5) row.push_back(kilobytes(t.total_bytes[s * kGammas + g]));
    table.row(std::move(row));
  }
  return table.text();
}

/// q_i(x, y) and d_i(x, y) of every stored fragment and scale at one Gamma.
std::string gamma_text(const PlaneTables& t, double gamma) {
  TextTable table;
  table.column("fragment");
  std::vector<AllocationFigures> scales;
  for (std::uint32_t s = 0; s <= t.scales; ++s) {
    table.column(fmt::format("q_{}", s));
    table.column(fmt::format("d_{} B", s));
    scales.push_back(allocation_figures(t, s, gamma));
  }
  for (const std::uint16_t i : t.order) {
    std::vector<std::string> row{std::to_string(i)};
    for (const AllocationFigures& f : scales) {
      row.push_back(fixed(static_cast<double>(f.fragment_quality[i]), 1));
      row.push_back(std::to_string(f.fragment_bytes[i]));
    }
    table.row(std::move(row));
  }
  return fmt::format(
             "  fragments by falling importance at Gamma {}: quality, 0 = skipped, and bytes at S_i\n",
             shortest(gamma)) +
         table.text();
}

std::string measured_text(const QualityTable& q) {
  TextTable table;
  table.column("scale");
  for (const int rung : q.rungs) table.column(fmt::format("SSIM q{}", rung));
  for (const int rung : q.rungs) table.column(fmt::format("diff q{}", rung));
  for (std::size_t s = 0; s < q.scales.size(); ++s) {
    std::vector<std::string> row{fmt::format("S_{}", q.scales[s])};
    for (std::size_t r = 0; r < q.rungs.size(); ++r)
      row.push_back(fixed(static_cast<double>(q.ssim[s * q.rungs.size() + r]), 4));
    for (std::size_t r = 0; r < q.rungs.size(); ++r)
      row.push_back(fixed(static_cast<double>(q.difference[s * q.rungs.size() + r]), 4));
    table.row(std::move(row));
  }
  return fmt::format("measured quality against S_0 with the source's texture ({} views of {} px)\n", q.views,
                     q.size_px) +
         table.text();
}

std::string tables_text(PackageReader& p, std::optional<double> gamma) {
  std::string s;
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const PlaneTables& t = p.tables().planes[k];
    s += plane_title(p.textures()[k], k);
    if (t.model_r > 0)
      s += fmt::format("  size model S = A R^Q + c: A {}, B {}, R {}; correlation {}, mean error {} %\n",
                       shortest(static_cast<double>(t.model_a)), shortest(static_cast<double>(t.model_b)),
                       shortest(static_cast<double>(t.model_r), 6),
                       fixed(static_cast<double>(t.model_correlation), 4),
                       percent(static_cast<double>(t.model_error)));
    else
      s += "  no size model: it needs two rungs\n";
    s += fmt::format(
        "  allocation {}, width {}, q within {} .. {}; D_i at {}, then by Gamma\n", allocation_name(t),
        shortest(static_cast<double>(t.allocation == 0 ? t.quality_width : t.log_width)),
        shortest(static_cast<double>(t.quality_min)), shortest(static_cast<double>(t.quality_max)),
        gamma ? "the Gamma asked for" : "the default Gamma");
    s += allocation_text(t, gamma) + (gamma ? gamma_text(t, *gamma) : "") + "\n";
  }
  return s + measured_text(p.quality());
}

std::string entries_text(PackageReader& p) {
  TextTable table("");
  table.column("offset");
  table.column("bytes");
  table.column("sha256", Align::kLeft);
  table.column("path", Align::kLeft);
  const nlohmann::ordered_json dumped = dump_json(p, DumpPart::kEntries);
  for (const auto& e : dumped["entries"])
    table.row({e["offset"].dump(), e["bytes"].dump(), e["sha256"], e["path"]});
  return table.text();
}

std::string provenance_text(PackageReader& p) {
  const Provenance provenance = read_provenance(p.entry(p.manifest().provenance));
  std::string s = fmt::format("made by   {}, format {}.{}\n\ninputs\n", printable(provenance.tool),
                              provenance.format_major, provenance.format_minor);
  TextTable inputs;
  inputs.column("role", Align::kLeft);
  inputs.column("bytes");
  inputs.column("sha256", Align::kLeft);
  inputs.column("uri", Align::kLeft);
  for (const auto& i : provenance.inputs) inputs.row({i.role, grouped(i.bytes), i.sha256, printable(i.uri)});
  s += inputs.text() + "\noptions\n";
  TextTable options;
  options.column("option", Align::kLeft);
  options.column("value", Align::kLeft);
  for (const auto& [stage, section] : provenance.options.items())
    if (section.is_object())
      for (const auto& [name, value] : section.items())
        options.row({printable(stage + "." + name), printable(value.dump())});
  s += options.text() + "\nversions\n";
  TextTable versions;
  versions.column("stage or library", Align::kLeft);
  versions.column("version");
  for (const auto& [name, version] : provenance.stages)
    versions.row({printable(name), std::to_string(version)});
  for (const auto& [name, version] : provenance.libraries)
    versions.row({printable(name), printable(version)});
  return s + versions.text();
}

std::string part_text(PackageReader& p, DumpPart part, std::optional<double> gamma) {
  switch (part) {
    case DumpPart::kSummary:
      return summary_text(p);
    case DumpPart::kScales:
      return scales_text(p);
    case DumpPart::kFragments:
      return fragments_text(p);
    case DumpPart::kLadder:
      return ladder_text(p);
    case DumpPart::kTables:
      return tables_text(p, gamma);
    case DumpPart::kEntries:
      return entries_text(p);
    default:
      return provenance_text(p);
  }
}

}  // namespace

std::string dump_text(PackageReader& package, DumpPart part, std::optional<double> gamma) {
  if (part != DumpPart::kAll) return part_text(package, part, gamma);
  std::string s;
  for (std::size_t k = 0; k + 1 < kDumpParts.size(); ++k) {
    if (k == static_cast<std::size_t>(DumpPart::kScales)) continue;  // stands in the summary
    s += (k ? "\n== " + std::string(kDumpParts[k]) + "\n" : "") +
         part_text(package, static_cast<DumpPart>(k), gamma);
  }
  return s;
}

}  // namespace texmesh
