#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace texmesh {

/// An option of a package that is not what this build would take by itself.
struct OptionChange {
  std::string name;      // "ladder.rungs"
  std::string value;     // JSON text
  std::string fallback;  // JSON text; "" where this build has no such option
};
/// `profile`: every option of a package, as its provenance holds them.
std::vector<OptionChange> changed_options(const nlohmann::ordered_json& profile);

}  // namespace texmesh
