#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "delivery/cpp/package/package_reader.h"

namespace texmesh {

/// The text of dump's part "perceptual": the thesis's Tables 7.1 and 7.2 of the package, and its major scales
/// at the package's JND.
std::string perceptual_text(PackageReader& package);
/// The same with all pairs of scales; null where the package does not say.
nlohmann::ordered_json perceptual_json(PackageReader& package);

}  // namespace texmesh
