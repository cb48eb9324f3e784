#pragma once

#include "delivery/cpp/package/package_reader.h"
#include "pipeline/io/record.h"

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
  kAnnotations,
  kProvenance,
  kAll
};
template <>
struct EnumNames<DumpPart> {
  static constexpr std::array<std::string_view, 12> names{"summary", "scales",      "fragments",  "ladder",
                                                          "tables",  "perceptual",  "atlas",      "entries",
                                                          "about",   "annotations", "provenance", "all"};
};

/// Gamma (0..1) at which the part "tables" shows the allocation, with every fragment's quality and bytes;
/// nothing: the default Gamma, without these.
using DumpGamma = std::optional<double>;

/// A page about one part of a package for people: aligned tables, units in the headers, bytes in decimal
/// units.
std::string dump_text(PackageReader& package, DumpPart part, DumpGamma gamma = {});

/// The same part as one JSON object, with every figure in full; `all` joins the parts' members. A
/// package without notes has no member "annotations". The shape
/// of `scales` is fixed: schemas/dump-scales.v1.schema.json.
nlohmann::ordered_json dump_json(PackageReader& package, DumpPart part, DumpGamma gamma = {});
DocumentSchema dump_scales_schema();

/// Entries by what they are for.
struct KindBytes {
  std::string kind;  // "meshes", "textures", ...
  std::uint64_t entries = 0, bytes = 0;
};
/// Entries of a package by what they are for, in a fixed order; kinds without entries are left out.
std::vector<KindBytes> bytes_by_kind(const Manifest& manifest, std::uint64_t manifest_bytes,
                                     const std::vector<EntryRef>& index);

/// Sums and means of a rung.
struct RungFigures {
  int quality = 0;
  std::uint64_t bytes = 0, table_bytes = 0;  // of all fragments; of the table stream
  double mse = 0, ssim = 1;                  // means over covered texels
  double surface_ssim = 1;                   // mean over the object's surface, see surface_weights()
};
std::vector<RungFigures> rung_figures(const PlaneTables& tables);

// Inside the room only: the parts that tell of texture planes (dump_textures.cpp).
std::string fragments_text(PackageReader& package, DumpGamma);
nlohmann::ordered_json fragments_json(PackageReader& package, DumpGamma);
std::string ladder_text(PackageReader& package, DumpGamma);
nlohmann::ordered_json ladder_json(PackageReader& package, DumpGamma);
std::string tables_text(PackageReader& package, DumpGamma);
nlohmann::ordered_json tables_json(PackageReader& package, DumpGamma);

}  // namespace texmesh
