#pragma once

#include "delivery/cpp/package/package_reader.h"
#include "pipeline/io/record.h"

namespace texmesh {

/// What packages can differ in.
enum class DifferenceKind : std::uint8_t { kInput, kOption, kAbout, kStageVersion, kLibrary, kTool, kFormat };
template <>
struct EnumNames<DifferenceKind> {
  static constexpr std::array<std::string_view, 7> names{"input",   "option", "about", "stage",
                                                         "library", "tool",   "format"};
};

// Lists of two hold A's value, then B's; null where that package has no such thing.
using TwoSizes = std::array<OrNull<std::uint64_t>, 2>;
inline constexpr FieldRule kTwo{.count = Range{2, 2}};
inline TwoSizes two_sizes(const std::array<std::uint64_t, 2>& bytes, bool a = true, bool b = true) {
  TwoSizes out;
  if (a) out[0].value = bytes[0];
  if (b) out[1].value = bytes[1];
  return out;
}
inline OrNull<std::string> text_or_null(const std::string& text) {
  return {text.empty() ? std::nullopt : std::optional(text)};
}

/// One thing that two packages do not share. Texts and sizes are those of A and B, empty or 0 where that
/// package has no such thing.
struct Difference {
  DifferenceKind kind;
  std::string name;  // uri ("" = the model itself), "ladder.rungs", "licence", stage, library
  std::array<std::string, 2> values;     // digest, JSON text, version
  std::array<std::uint64_t, 2> bytes{};  // inputs only
  static void fields(auto& s, auto&& v) {
    v("kind", s.kind, "");
    v("name", s.name,
      "Input: the name by which the model refers to it, empty for the model itself. Option: stage.option.");
    v("values", std::array{text_or_null(s.values[0]), text_or_null(s.values[1])}, kTwo, "");
    std::optional<TwoSizes> sizes;
    if (s.kind == DifferenceKind::kInput)
      sizes = two_sizes(s.bytes, !s.values[0].empty(), !s.values[1].empty());
    v("bytes", sizes, kTwo, "");
  }
};

struct EntryDifference {
  std::string path;
  std::string stage;  // that made it; "" for the record of provenance itself
  std::array<bool, 2> present{};
  std::array<std::uint64_t, 2> bytes{};
  static void fields(auto& s, auto&& v) {
    v("path", s.path, "");
    v("stage", text_or_null(s.stage), "");
    v("in", s.present, kTwo, "");
    v("bytes", two_sizes(s.bytes, s.present[0], s.present[1]), kTwo, "");
  }
};

/// A stage whose entries differ, and every recorded difference that can reach it through the graph.
struct StageDifference {
  std::string stage;
  std::uint64_t entries = 0;
  std::array<std::uint64_t, 2> bytes{};
  std::vector<std::size_t> causes;  // indices into PackageDiff::differences; empty = none is recorded
  static void fields(auto& s, auto&& v) {
    v("stage", s.stage, "");
    v("entries", s.entries, "");
    v("bytes", two_sizes(s.bytes), kTwo, "");
    v("causes", s.causes, "Indices into `recorded`: what can reach this stage.");
  }
};

struct DiffedPackage {
  std::string name, id;
  std::uint64_t bytes = 0;
  static void fields(auto& s, auto&& v) {
    v("name", s.name, "");
    v("id", s.id, FieldRule{.pattern = "^[0-9a-f]{64}$"}, "");
    v("bytes", s.bytes, "Of all entries.");
  }
};

struct PackageDiff {
  std::array<std::string, 2> names, ids;  // as the user calls the packages; package ids, hexadecimal
  std::array<std::uint64_t, 2> bytes{};   // of all entries
  std::vector<Difference> differences;    // inputs, options, fields of about.json, versions ...
  std::vector<EntryDifference> entries;   // in A's order, then those that only B has
  std::vector<StageDifference> stages;    // in the order of the graph
  std::uint64_t equal_entries = 0;
  bool equal() const { return ids[0] == ids[1]; }
  static void fields(auto& s, auto&& v) {
    const std::array packages{DiffedPackage{s.names[0], s.ids[0], s.bytes[0]},
                              DiffedPackage{s.names[1], s.ids[1], s.bytes[1]}};
    v("version", Constant{1}, "");
    v("equal", s.equal(), "The same package id: every byte is the same.");
    v("packages", packages, kTwo, "");
    v("recorded", s.differences, "What the packages were made from and with, where it differs.");
    v("stages", s.stages, "Stages whose entries differ, in the order of the graph.");
    v("entries", s.entries, "");
    v("equal_entries", s.equal_entries, "");
  }
};

/// What differs between two packages and why, from their indices and provenance; reads no meshes or textures.
/// Causes follow the graph of this build's stages: a cause can have changed an entry, but need not have.
/// FormatError for packages that cannot be read.
PackageDiff diff_packages(PackageReader& a, PackageReader& b, const std::array<std::string, 2>& names);

std::string diff_text(const PackageDiff& diff);
DocumentSchema diff_schema();

}  // namespace texmesh
