#include "pipeline/graph/option_text.h"

#include <nlohmann/json.hpp>

namespace texmesh {

std::string option_text(bool value) { return value ? "true" : "false"; }
std::string option_text(int value) { return std::to_string(value); }
std::string option_text(double value) { return nlohmann::json(value).dump(); }
std::string option_text(std::string_view value) { return nlohmann::json(value).dump(); }
std::string option_text(const std::vector<int>& values) { return nlohmann::json(values).dump(); }
std::string option_text(const std::vector<double>& values) { return nlohmann::json(values).dump(); }

}  // namespace texmesh
