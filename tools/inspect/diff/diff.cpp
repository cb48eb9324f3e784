#include "tools/inspect/diff/diff.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/compile/stage_table.h"
#include "pipeline/io/names/closest_word.h"
#include "pipeline/io/table.h"
#include "tools/inspect/provenance.h"

namespace texmesh {
namespace {

/// Compares two lists of named things and notes what is not the same, in A's order, then B's own.
class NamedDifferences {
 public:
  explicit NamedDifferences(DifferenceKind kind) : kind_(kind) {}
  void add(int side, const std::string& name, std::string value, std::uint64_t bytes = 0) {
    const auto [it, fresh] = place_.emplace(name, all_.size());
    if (fresh) all_.push_back({kind_, name, {}, {}});
    all_[it->second].values[side] = std::move(value);
    all_[it->second].bytes[side] = bytes;
  }
  void append_to(std::vector<Difference>& differences) const {
    for (const Difference& d : all_)
      if (d.values[0] != d.values[1]) differences.push_back(d);
  }

 private:
  DifferenceKind kind_;
  std::map<std::string, std::size_t> place_;
  std::vector<Difference> all_;
};

/// Fields of about.json by name, "identifier doi" by what it is of. What the source said verbatim is one
/// field.
void add_about(int side, const About& about, NamedDifferences& fields) {
  const auto add_list = [&](const char* name, const std::vector<NamedText>& list) {
    std::map<std::string, std::string> texts;
    for (const NamedText& item : list) {
      std::string& text = texts[std::string(name) + " " + item.name];
      text += (text.empty() ? "" : "; ") + item.text;
    }
    for (auto& [key, text] : texts) fields.add(side, key, std::move(text));
  };
  for (NamedText& line : about_lines(about))
    if (line.name != "identifier" && line.name != "date") fields.add(side, line.name, std::move(line.text));
  add_list("identifier", about.identifiers);
  add_list("date", about.dates);
  for (const auto& [name, json] :
       {std::pair{"what the source said", &about.source}, {"extras", &about.extras}})
    if (!json->empty()) fields.add(side, name, to_hex(sha256(text_bytes(*json))));
}

std::vector<Difference> differences_of(const std::array<Provenance, 2>& p,
                                       const std::array<About, 2>& about) {
  NamedDifferences inputs(DifferenceKind::kInput), options(DifferenceKind::kOption),
      fields(DifferenceKind::kAbout), stages(DifferenceKind::kStageVersion),
      libraries(DifferenceKind::kLibrary), tool(DifferenceKind::kTool), format(DifferenceKind::kFormat);
  for (int side = 0; side < 2; ++side) {
    for (const Provenance::Input& i : p[side].inputs) inputs.add(side, i.uri, i.sha256, i.bytes);
    for (const auto& [stage, section] : p[side].options->items())
      if (section.is_object())
        for (const auto& [name, value] : section.items()) options.add(side, stage + "." + name, value.dump());
    add_about(side, about[side], fields);
    for (const auto& [name, version] : p[side].stages) stages.add(side, name, std::to_string(version));
    for (const auto& [name, version] : p[side].libraries) libraries.add(side, name, version);
    tool.add(side, "tool", p[side].tool);
    format.add(side, "package format", p[side].format.text());
  }
  std::vector<Difference> all;
  for (const NamedDifferences* list : {&inputs, &options, &fields, &stages, &libraries, &tool, &format})
    list->append_to(all);
  return all;
}

/// The stage that makes an entry.
std::string maker(const std::string& path) {
  using Kind = EntryKind;
  static const std::map<Kind, std::string> makers{
      {Kind::kMesh, "scales"},           {Kind::kSplitStream, "scales"},   {Kind::kProxy, "proxies"},
      {Kind::kPoster, "poster"},         {Kind::kTables, "lut"},           {Kind::kThesis, "lut"},
      {Kind::kQuality, "quality"},       {Kind::kPreview, "previews"},     {Kind::kTableStreams, "ladder"},
      {Kind::kRung, "ladder"},           {Kind::kTextures, "ladder"},      {Kind::kProvenance, ""},
      {Kind::kGltfScale, "gltf_scales"}, {Kind::kGltfImage, "gltf_scales"}};
  const auto found = makers.find(parse_entry_path(path).kind);
  return found == makers.end() ? "package" : found->second;
}

void compare_entries(PackageReader& a, PackageReader& b, PackageDiff& diff) {
  const std::vector<EntryRef> of_a = a.entries(), of_b = b.entries();
  std::map<std::string, const EntryRef*> others;
  for (const EntryRef& e : of_b) {
    others.emplace(e.path, &e);
    diff.bytes[1] += e.bytes;
  }
  if (!diff.equal())
    diff.entries.push_back({kManifestPath,
                            "package",
                            {true, true},
                            {a.store().read_manifest().size(), b.store().read_manifest().size()}});
  for (const EntryRef& e : of_a) {
    diff.bytes[0] += e.bytes;
    const auto it = others.find(e.path);
    const EntryRef* other = it == others.end() ? nullptr : it->second;
    if (other) others.erase(it);
    if (other && other->digest == e.digest && other->bytes == e.bytes)
      ++diff.equal_entries;
    else
      diff.entries.push_back(
          {e.path, maker(e.path), {true, other != nullptr}, {e.bytes, other ? other->bytes : 0}});
  }
  for (const EntryRef& e : of_b)
    if (others.contains(e.path)) diff.entries.push_back({e.path, maker(e.path), {false, true}, {0, e.bytes}});
}

bool is_image(const std::string& uri) {
  const auto dot = uri.find_last_of('.');
  const std::string extension = in_lower_case(dot == std::string::npos ? "" : uri.substr(dot + 1));
  // What can hold a mesh or materials; anything else that a model names is an image.
  static const std::set<std::string> others{"", "bin", "mtl", "glbin", "gltf", "glb"};
  return !others.contains(extension);
}

/// Which recorded differences can reach an artefact.
class Causes {
 public:
  explicit Causes(const std::vector<Difference>& differences) : differences_(differences) {
    for (const Stage& s : default_stage_table())
      for (const StageOutput& output : s.outputs) makers_[output.name] = &s;
  }

  std::vector<std::size_t> of(const std::string& stage) {
    reached_.clear();
    seen_.clear();
    for (const Stage& s : default_stage_table())
      if (s.name == stage) visit(s, "");
    return {reached_.begin(), reached_.end()};
  }

 private:
  void visit(const Stage& s, const std::string& artefact) {
    if (!seen_.insert(s.name + "/" + artefact).second) return;
    for (std::size_t i = 0; i < differences_.size(); ++i)
      if (touches(differences_[i], s, artefact)) reached_.insert(i);
    for (const ArtefactName& input : s.inputs)
      if (const auto it = makers_.find(input.name); it != makers_.end()) visit(*it->second, input.name);
  }

  static bool touches(const Difference& d, const Stage& s, const std::string& artefact) {
    switch (d.kind) {
      case DifferenceKind::kInput:
        return s.name == "import" && (artefact == "import.images" || d.name.empty() || !is_image(d.name));
      case DifferenceKind::kOption:
        return std::any_of(s.options.begin(), s.options.end(), [&](const StageOption& o) {
          return d.name == o.name || d.name.starts_with(o.name + ".");
        });
      case DifferenceKind::kStageVersion:
        return d.name == s.name;
      case DifferenceKind::kLibrary:
        return std::any_of(s.libraries.begin(), s.libraries.end(),
                           [&](const StageLibrary& l) { return l.name == d.name; });
      case DifferenceKind::kAbout:
      case DifferenceKind::kTool:
      case DifferenceKind::kFormat:
        return s.name == "package";
    }
    return false;
  }

  const std::vector<Difference>& differences_;
  std::map<std::string, const Stage*> makers_;
  std::set<std::size_t> reached_;
  std::set<std::string> seen_;
};

std::vector<StageDifference> by_stage(const PackageDiff& diff) {
  Causes causes(diff.differences);
  std::vector<StageDifference> stages;
  for (const Stage& s : default_stage_table()) {
    StageDifference d{s.name, 0, {}, {}};
    for (const EntryDifference& e : diff.entries)
      if (e.stage == s.name) {
        ++d.entries;
        for (int side = 0; side < 2; ++side) d.bytes[side] += e.bytes[side];
      }
    if (d.entries == 0) continue;
    d.causes = causes.of(s.name);
    stages.push_back(std::move(d));
  }
  return stages;
}

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

std::string head_text(const PackageDiff& diff) {
  Table table("", {Column::text(""), Column::text("package"), Column::text("id"), {"bytes", kGrouped}});
  for (int side = 0; side < 2; ++side)
    table.row({side ? "B" : "A", diff.names[side], diff.ids[side].substr(0, 16), diff.bytes[side]});
  return table.text("");
}

std::string recorded_text(const PackageDiff& diff) {
  if (diff.differences.empty())
    return "recorded: inputs, options, what is said of the object, stages, libraries and tool are the same\n";
  Table table("what the packages were made from and with",
              {Column::text("recorded"), Column::text("what"), Column::text("A"), Column::text("B")});
  for (const Difference& d : diff.differences)
    table.row({enum_name(d.kind), name_of(d), value_of(d, 0), value_of(d, 1)});
  return table.text();
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

}  // namespace

PackageDiff diff_packages(PackageReader& a, PackageReader& b, const std::array<std::string, 2>& names) {
  PackageDiff diff;
  diff.names = names;
  diff.ids = {to_hex(a.id()), to_hex(b.id())};
  diff.differences = differences_of(
      {read_provenance(a.entry(a.manifest().provenance)), read_provenance(b.entry(b.manifest().provenance))},
      {a.about(), b.about()});
  compare_entries(a, b, diff);
  diff.stages = by_stage(diff);
  return diff;
}

std::string diff_text(const PackageDiff& diff) {
  if (diff.equal())
    return fmt::format("{} and {} are the same package ({})\n", printable(diff.names[0]),
                       printable(diff.names[1]), diff.ids[0].substr(0, 16));
  return head_text(diff) + "\n" + recorded_text(diff) + "\n" + contents_text(diff);
}

DocumentSchema diff_schema() {
  Json body = schema_of<PackageDiff>();
  Json& recorded = body["properties"]["recorded"]["items"];
  recorded["if"] = {{"properties", {{"kind", {{"const", "input"}}}}}};
  recorded["then"] = {{"required", {"bytes"}}};
  return document_schema(
      "diff.v1", "texmesh diff report, version 1",
      "Output of `texmesh diff A B --json`. Lists of two hold A's value, then B's; null where "
      "that package has no such thing.",
      body);
}

}  // namespace texmesh
