#pragma once
#include <string>

#include "delivery/cpp/package/package_reader.h"

namespace texmesh {

/// The text of dump's part "scales".
std::string scales_text(PackageReader& package);
/// The text of dump's part "summary", scales included.
std::string summary_text(PackageReader& package);

}  // namespace texmesh
