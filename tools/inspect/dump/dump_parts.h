#pragma once
// Inside the room only: the parts of a dump, as text and as members of its JSON. What both show stands in one
// Table.
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "delivery/cpp/package/package_reader.h"

namespace texmesh {

/// Gamma at which the part "tables" shows the allocation; nothing: the default Gamma.
using DumpGamma = std::optional<double>;

std::string summary_text(PackageReader& package, DumpGamma);
nlohmann::ordered_json summary_json(PackageReader& package, DumpGamma);
std::string scales_text(PackageReader& package, DumpGamma);
nlohmann::ordered_json scales_json(PackageReader& package, DumpGamma);
std::string fragments_text(PackageReader& package, DumpGamma);
nlohmann::ordered_json fragments_json(PackageReader& package, DumpGamma);
std::string ladder_text(PackageReader& package, DumpGamma);
nlohmann::ordered_json ladder_json(PackageReader& package, DumpGamma);
/// With `gamma` also what every fragment gets at that Gamma.
std::string tables_text(PackageReader& package, DumpGamma gamma);
nlohmann::ordered_json tables_json(PackageReader& package, DumpGamma gamma);
/// The thesis's Tables 7.1 and 7.2 of the package, and its major scales at the package's JND.
std::string perceptual_text(PackageReader& package, DumpGamma);
/// The same with all pairs of scales; null where the package does not say.
nlohmann::ordered_json perceptual_json(PackageReader& package, DumpGamma);

}  // namespace texmesh
