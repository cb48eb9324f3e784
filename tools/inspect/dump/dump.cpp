#include "tools/inspect/dump/dump.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/io/table.h"
#include "tools/inspect/atlas/atlas_report.h"
#include "tools/inspect/dump/dump_parts.h"
#include "tools/inspect/provenance.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

Table entries_table(PackageReader& p) {
  Table table("", {{"offset", 0, "offset"},
                   {"bytes", 0, "bytes"},
                   Column::text("sha256", "sha256"),
                   Column::text("path", "path")});
  for (const ContainerEntry& e : p.store().list())
    if (e.path == kManifestPath) table.row({e.offset, e.bytes, to_hex(p.id()), e.path});
  std::vector<EntryRef> entries = p.index();
  const EntryRef& index = p.manifest().index;
  entries.insert(std::ranges::upper_bound(entries, index.offset, {}, &EntryRef::offset), index);
  for (const EntryRef& e : entries) table.row({e.offset, e.bytes, to_hex(e.digest), e.path});
  return table;
}

std::string entries_text(PackageReader& p, DumpGamma) { return entries_table(p).text(""); }
Json entries_json(PackageReader& p, DumpGamma) { return {{"entries", entries_table(p).json()}}; }

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
  return fmt::format("made by   {}, format {}.{}\n\n", printable(provenance.tool), provenance.format_major,
                     provenance.format_minor) +
         inputs.text() + "\n" + options.text() + "\n" + versions.text();
}

Json provenance_json(PackageReader& p, DumpGamma) {
  const auto bytes = p.entry(p.manifest().provenance);
  read_provenance(bytes);  // refuse what verify would refuse
  return {{"provenance", Json::parse(bytes.begin(), bytes.end())}};
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

Json about_json(PackageReader& p, DumpGamma) {
  const auto bytes = p.entry(p.manifest().about);
  read_about(bytes);
  return {{"about", Json::parse(bytes.begin(), bytes.end())}};
}

std::string atlas_part_text(PackageReader& p, DumpGamma) {
  return atlas_text(diagnose_atlases(atlas_subject(p, {}), {}));
}
Json atlas_part_json(PackageReader& p, DumpGamma) {
  return {{"atlas", atlas_json(diagnose_atlases(atlas_subject(p, {}), {}))}};
}

struct PartWriters {
  std::string (*text)(PackageReader&, DumpGamma);
  Json (*json)(PackageReader&, DumpGamma);
};
/// In the order of DumpPart.
constexpr std::array<PartWriters, kDumpParts.size() - 1> kWriters{{{summary_text, summary_json},
                                                                   {scales_text, scales_json},
                                                                   {fragments_text, fragments_json},
                                                                   {ladder_text, ladder_json},
                                                                   {tables_text, tables_json},
                                                                   {perceptual_text, perceptual_json},
                                                                   {atlas_part_text, atlas_part_json},
                                                                   {entries_text, entries_json},
                                                                   {about_text, about_json},
                                                                   {provenance_text, provenance_json}}};

}  // namespace

std::string dump_text(PackageReader& package, DumpPart part, std::optional<double> gamma) {
  if (part != DumpPart::kAll) return kWriters[static_cast<std::size_t>(part)].text(package, gamma);
  std::string s;
  for (std::size_t k = 0; k < kWriters.size(); ++k) {
    if (k == static_cast<std::size_t>(DumpPart::kScales)) continue;  // stands in the summary
    s += (k ? "\n== " + std::string(kDumpParts[k]) + "\n" : "") + kWriters[k].text(package, gamma);
  }
  return s;
}

Json dump_json(PackageReader& package, DumpPart part, std::optional<double> gamma) {
  if (part != DumpPart::kAll) return kWriters[static_cast<std::size_t>(part)].json(package, gamma);
  Json all = Json::object();
  for (const PartWriters& writers : kWriters) all.update(writers.json(package, gamma));
  return all;
}

}  // namespace texmesh
