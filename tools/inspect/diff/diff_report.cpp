#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "pipeline/io/text_table.h"
#include "tools/inspect/diff/diff.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

/// Entries are many where a rung list changes; a person needs the first few of each stage.
constexpr std::size_t kEntriesShown = 8;

std::string name_of(const Difference& d) {
  if (d.kind == DifferenceKind::kInput) return d.name.empty() ? "the model itself" : printable(d.name);
  return printable(d.name);
}

std::string value_of(const Difference& d, int side) {
  const std::string& v = d.values[side];
  if (v.empty()) return "-";
  if (d.kind == DifferenceKind::kInput) return grouped(d.bytes[side]) + " bytes, " + v.substr(0, 12);
  if (d.kind == DifferenceKind::kStageVersion) return "version " + v;
  return printable(v);
}

std::string head_text(const PackageDiff& diff, const std::array<std::string, 2>& names) {
  TextTable table;
  table.column("", Align::kLeft);
  table.column("package", Align::kLeft);
  table.column("id", Align::kLeft);
  table.column("bytes");
  for (int side = 0; side < 2; ++side)
    table.row(
        {side ? "B" : "A", printable(names[side]), diff.ids[side].substr(0, 16), grouped(diff.bytes[side])});
  return table.text("");
}

std::string recorded_text(const PackageDiff& diff) {
  if (diff.differences.empty())
    return "recorded: inputs, options, what is said of the object, stages, libraries and tool are the same\n";
  TextTable table;
  for (const char* header : {"recorded", "what", "A", "B"}) table.column(header, Align::kLeft);
  for (const Difference& d : diff.differences)
    table.row({std::string(enum_name(d.kind)), name_of(d), value_of(d, 0), value_of(d, 1)});
  return "what the packages were made from and with\n" + table.text();
}

std::string because(const PackageDiff& diff, const StageDifference& s) {
  std::string text;
  for (const std::size_t i : s.causes) {
    const Difference& d = diff.differences[i];
    text += (text.empty() ? "" : ", ") + std::string(enum_name(d.kind)) + " " + name_of(d);
  }
  return text.empty()
             ? "nothing recorded: one of the packages was not made by this tool as it says, run verify"
             : text;
}

std::string entries_of(const PackageDiff& diff, const StageDifference& s) {
  std::string text;
  std::size_t shown = 0;
  for (const EntryDifference& e : diff.entries) {
    if (e.stage != s.stage) continue;
    if (++shown > kEntriesShown) continue;
    const std::string path = printable(e.path);
    if (!e.present[1])
      text += fmt::format("    only in A  {}  {} bytes\n", path, grouped(e.bytes[0]));
    else if (!e.present[0])
      text += fmt::format("    only in B  {}  {} bytes\n", path, grouped(e.bytes[1]));
    else
      text +=
          fmt::format("    differs    {}  {} -> {} bytes\n", path, grouped(e.bytes[0]), grouped(e.bytes[1]));
  }
  if (shown > kEntriesShown)
    text += fmt::format("    ... and {} more (--json lists all)\n", shown - kEntriesShown);
  return text;
}

std::string contents_text(const PackageDiff& diff) {
  std::string text;
  for (const StageDifference& s : diff.stages) {
    text += fmt::format("{}: {} entr{} differ{}, {} -> {} bytes; can come from: {}\n", s.stage, s.entries,
                        s.entries == 1 ? "y" : "ies", s.entries == 1 ? "s" : "", grouped(s.bytes[0]),
                        grouped(s.bytes[1]), because(diff, s));
    text += entries_of(diff, s);
  }
  return text + fmt::format("{} entries are the same\n", grouped(diff.equal_entries));
}

Json pair(const std::array<std::string, 2>& values) {
  Json list = Json::array();
  for (const std::string& v : values) list.push_back(v.empty() ? Json() : Json(v));
  return list;
}

Json sizes(const std::array<std::uint64_t, 2>& bytes, bool a = true, bool b = true) {
  return Json::array({a ? Json(bytes[0]) : Json(), b ? Json(bytes[1]) : Json()});
}

Json recorded_json(const Difference& d) {
  Json j{{"kind", enum_name(d.kind)}, {"name", d.name}, {"values", pair(d.values)}};
  if (d.kind == DifferenceKind::kInput)
    j["bytes"] = sizes(d.bytes, !d.values[0].empty(), !d.values[1].empty());
  return j;
}

}  // namespace

std::string diff_text(const PackageDiff& diff, const std::array<std::string, 2>& names) {
  if (diff.equal())
    return fmt::format("{} and {} are the same package ({})\n", printable(names[0]), printable(names[1]),
                       diff.ids[0].substr(0, 16));
  return head_text(diff, names) + "\n" + recorded_text(diff) + "\n" + contents_text(diff);
}

nlohmann::ordered_json diff_json(const PackageDiff& diff, const std::array<std::string, 2>& names) {
  Json packages = Json::array(), recorded = Json::array(), stages = Json::array(), entries = Json::array();
  for (int side = 0; side < 2; ++side)
    packages.push_back({{"name", names[side]}, {"id", diff.ids[side]}, {"bytes", diff.bytes[side]}});
  for (const Difference& d : diff.differences) recorded.push_back(recorded_json(d));
  for (const StageDifference& s : diff.stages)
    stages.push_back(
        {{"stage", s.stage}, {"entries", s.entries}, {"bytes", sizes(s.bytes)}, {"causes", s.causes}});
  for (const EntryDifference& e : diff.entries)
    entries.push_back({{"path", e.path},
                       {"stage", e.stage.empty() ? Json() : Json(e.stage)},
                       {"in", Json::array({e.present[0], e.present[1]})},
                       {"bytes", sizes(e.bytes, e.present[0], e.present[1])}});
  return {{"version", 1},
          {"equal", diff.equal()},
          {"packages", packages},
          {"recorded", recorded},
          {"stages", stages},
          {"entries", entries},
          {"equal_entries", diff.equal_entries}};
}

}  // namespace texmesh
