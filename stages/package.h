#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "format/manifest.h"
#include "format/tables.h"
#include "stages/fragmentation.h"
#include "stages/ladder.h"
#include "stages/lut.h"
#include "stages/perceptual_values.h"
#include "stages/scales.h"
#include "stages/simplification.h"

namespace texmesh {

inline constexpr int kPackageVersion = 1;

struct PackageOptions {
  std::string title;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("title", s.title, "shown by viewers; nothing is taken from file names");
  }
};

struct PackageEntry {
  std::string path;
  std::vector<std::uint8_t> bytes;
};

/// Lays out the container (design section 4): manifest, index, tables, textures, coarsest mesh, previews, table
/// streams, quality, then texture rungs from low to high between the meshes from coarse to fine, provenance last.
/// `provenance_json` is made by the pipeline (options, input digests, stage versions; no dates, hosts or paths).
std::vector<std::uint8_t> assemble_package(const NestedScales& scales, const PerceptualValues& perceptual,
                                           const std::vector<Image>& images, const Fragments& fragments,
                                           const Ladder& ladder, const PackageTables& tables, const ScaleFiles& files,
                                           const QualityTable& quality, double jnd, const std::string& provenance_json,
                                           const PackageOptions& options, const RunContext& context);

/// Lays out and writes entries that are already final except for the offsets in manifest and index, in
/// streaming_order(). `entries` holds all but manifest.json, index.bin and textures.json, which are made here from the
/// arguments (refs and offsets in them are filled in). `pack` needs no new layout: it hands the files of a tree to
/// ContainerWriter in index order.
std::vector<std::uint8_t> write_package(Manifest manifest, std::vector<TextureInfo> textures,
                                        const std::vector<PackageEntry>& entries);

}  // namespace texmesh
