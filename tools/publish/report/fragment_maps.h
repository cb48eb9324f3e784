#pragma once
#include <string>

#include "delivery/cpp/package/package_reader.h"

namespace texmesh {

/// What stands on the fragments of a plane: 0..1, -1 = not stored.
struct FragmentHeat {
  std::string name;           // plain text: what the colours mean
  std::vector<double> value;  // per fragment; empty = the grid alone
};
/// Bytes per covered texel at the best rung, and feature density eta of S_0; each over its largest value.
std::vector<FragmentHeat> fragment_heats(PackageReader& package, std::uint32_t plane);

/// The plane's preview, a file of that name beside the page, beneath the grid of fragments in heat colours.
/// HTML; `plane` is a full-size one.
std::string fragment_map(PackageReader& package, std::uint32_t plane, const FragmentHeat& heat,
                         const std::string& preview);

}  // namespace texmesh
