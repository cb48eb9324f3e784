#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pipeline/io/text_table.h"
#include "tools/inspect/atlas/atlas_report.h"
#include "tools/inspect/dump/dump.h"
#include "tools/inspect/dump/dump_perceptual.h"
#include "tools/inspect/dump/dump_summary.h"
#include "tools/inspect/dump/dump_textures.h"
#include "tools/inspect/provenance.h"

namespace texmesh {
namespace {

std::string entries_text(PackageReader& p) {
  TextTable table;
  table.column("offset");
  table.column("bytes");
  table.column("sha256", Align::kLeft);
  table.column("path", Align::kLeft);
  const nlohmann::ordered_json dumped = dump_json(p, DumpPart::kEntries);
  for (const auto& e : dumped["entries"])
    table.row({e["offset"].dump(), e["bytes"].dump(), e["sha256"].get<std::string>(),
               e["path"].get<std::string>()});
  return table.text("");
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
  for (const auto& [stage, section] : provenance.options->items())
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

/// What the source said is JSON of strangers: escaped, so that a terminal sees no control characters.
std::string verbatim_text(const char* title, const std::string& json) {
  if (json.empty()) return "";
  return fmt::format("\n{}\n{}\n", title,
                     nlohmann::ordered_json::parse(json).dump(
                         1, ' ', true, nlohmann::ordered_json::error_handler_t::replace));
}

std::string about_text(PackageReader& p) {
  const About& about = p.about();
  TextTable table;
  table.column("about", Align::kLeft);
  table.column("", Align::kLeft);
  const std::vector<NamedText> lines = about_lines(about);
  for (const NamedText& line : lines) table.row({line.name, printable(line.text)});
  return (lines.empty() ? "about: nothing is known\n" : table.text()) +
         verbatim_text("what the publisher added", about.extras) +
         verbatim_text("what the source said", about.source);
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
    case DumpPart::kPerceptual:
      return perceptual_text(p);
    case DumpPart::kAtlas:
      return atlas_text(diagnose_atlases(atlas_subject(p, {}), {}));
    case DumpPart::kEntries:
      return entries_text(p);
    case DumpPart::kAbout:
      return about_text(p);
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
