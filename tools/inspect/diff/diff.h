#pragma once
#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/fields.h"

namespace texmesh {

struct DocumentSchema;  // pipeline/io/record.h

/// What packages can differ in.
enum class DifferenceKind : std::uint8_t { kInput, kOption, kAbout, kStageVersion, kLibrary, kTool, kFormat };
template <>
struct EnumNames<DifferenceKind> {
  static constexpr std::array<std::string_view, 7> names{"input",   "option", "about", "stage",
                                                         "library", "tool",   "format"};
};

/// One thing that two packages do not share. Texts and sizes are those of A and B, empty or 0 where that
/// package has no such thing.
struct Difference {
  DifferenceKind kind;
  std::string name;  // uri ("" = the model itself), "ladder.rungs", "licence", stage, library
  std::array<std::string, 2> values;     // digest, JSON text, version
  std::array<std::uint64_t, 2> bytes{};  // inputs only
};

struct EntryDifference {
  std::string path;
  std::string stage;  // that made it; "" for the record of provenance itself
  std::array<bool, 2> present{};
  std::array<std::uint64_t, 2> bytes{};
};

/// A stage whose entries differ, and every recorded difference that can reach it through the graph.
struct StageDifference {
  std::string stage;
  std::uint64_t entries = 0;
  std::array<std::uint64_t, 2> bytes{};
  std::vector<std::size_t> causes;  // indices into PackageDiff::differences; empty = none is recorded
};

struct PackageDiff {
  std::array<std::string, 2> ids;        // package ids, hexadecimal
  std::array<std::uint64_t, 2> bytes{};  // of all entries
  std::vector<Difference> differences;   // inputs, options, fields of about.json, versions ...
  std::vector<EntryDifference> entries;  // in A's order, then those that only B has
  std::vector<StageDifference> stages;   // in the order of the graph
  std::uint64_t equal_entries = 0;
  bool equal() const { return ids[0] == ids[1]; }
};

/// What differs between two packages and why, from their indices and provenance; reads no meshes or textures.
/// Causes follow the graph of this build's stages: a cause can have changed an entry, but need not have.
/// FormatError for packages that cannot be read.
PackageDiff diff_packages(PackageReader& a, PackageReader& b);

std::string diff_text(const PackageDiff& diff, const std::array<std::string, 2>& names);
/// schemas/diff.v1.schema.json.
nlohmann::ordered_json diff_json(const PackageDiff& diff, const std::array<std::string, 2>& names);
DocumentSchema diff_schema();

}  // namespace texmesh
