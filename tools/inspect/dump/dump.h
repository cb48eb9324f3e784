#pragma once
#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "delivery/cpp/package/package_reader.h"

namespace texmesh {

enum class DumpPart : std::uint8_t {
  kSummary,
  kScales,
  kFragments,
  kLadder,
  kTables,
  kPerceptual,
  kAtlas,
  kEntries,
  kAbout,
  kProvenance,
  kAll
};
inline constexpr std::array<std::string_view, 11> kDumpParts{"summary", "scales",     "fragments", "ladder",
                                                             "tables",  "perceptual", "atlas",     "entries",
                                                             "about",   "provenance", "all"};

/// A page about one part of a package for people: aligned tables, units in the headers, bytes in decimal
/// units. With `gamma` (0..1) `tables` are at it instead of the default Gamma, with every fragment's
/// quality and bytes.
std::string dump_text(PackageReader& package, DumpPart part, std::optional<double> gamma = {});

/// The same part as one JSON object, with every figure in full; `all` joins the parts' members. The shape
/// of `scales` is fixed: {"scales":[{"scale":9,"triangles":..,"vertices":..,"bytes":..,"major":true,..},
/// ..]}, S_0 first.
nlohmann::ordered_json dump_json(PackageReader& package, DumpPart part, std::optional<double> gamma = {});

}  // namespace texmesh
