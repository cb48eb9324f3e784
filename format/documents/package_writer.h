#pragma once

#include "format/documents/manifest.h"
#include "format/documents/textures.h"

namespace texmesh {

struct PackageEntry {
  std::string path;
  std::vector<std::uint8_t> bytes;
};

/// Lays out and writes entries that are already final except for the offsets in manifest and index, in
/// streaming_order(). `entries` holds all but manifest.json, index.bin and textures.json, which are made
/// here from the arguments (refs and offsets in them are filled in; of a poster the manifest has the sides,
/// of proxies, which are the entries proxy_path(0), ..., the figures). `pack` needs no new layout: it hands
/// the files of a tree to ContainerWriter in index order. FormatError when an entry is missing or a value
/// breaks a rule.
std::vector<std::uint8_t> write_package(Manifest manifest, std::vector<TextureInfo> textures,
                                        const std::vector<PackageEntry>& entries);

}  // namespace texmesh
