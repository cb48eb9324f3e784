#pragma once
// The rules between documents of a package, for its reader and for what checks whole packages: each function
// adds a finding for every breach.
#include "delivery/cpp/package/package_reader.h"
#include "format/base/finding.h"

namespace texmesh {

/// What a finding calls a part of a plane's tables: "plane 3, grid".
std::string plane_field(std::size_t plane, const std::string& member);

/// Every place that the manifest names (offset, bytes, digest) is where the index has it.
void check_references(const Manifest& manifest, const std::vector<EntryRef>& index, Findings& findings);

/// As many planes as the manifest says, of codecs whose features it requires.
void check_textures(const Manifest& manifest, const std::vector<TextureInfo>& textures, Findings& findings);
/// tables.bin against manifest and textures: planes, grids, scales, rungs, sizes of entries.
void check_tables(const Manifest& manifest, const std::vector<TextureInfo>& textures,
                  const PackageTables& tables, Findings& findings);

/// quality.json is of the package's scales and of the groups of its planes.
void check_scales_and_groups(const Manifest& manifest, const std::vector<TextureInfo>& textures,
                             const QualityTable& quality, Findings& findings);

}  // namespace texmesh
