#pragma once
#include <optional>
#include <string>

#include "delivery/cpp/package/package_reader.h"

namespace texmesh {

// The texts of dump's parts "fragments", "ladder" and "tables".

std::string fragments_text(PackageReader& package);
std::string ladder_text(PackageReader& package);
/// With `gamma` also what every fragment gets at that Gamma.
std::string tables_text(PackageReader& package, std::optional<double> gamma);

}  // namespace texmesh
