#pragma once
#include <nlohmann/json.hpp>
#include <string>

namespace texmesh {

/// `head` with one more member, the array `list`, of which every element has a line: a million of them are
/// never one JSON document in memory. `json_of` makes the JSON of an item; what is no UTF-8 becomes U+FFFD.
template <class Items, class JsonOf>
std::string json_with_lines(const nlohmann::ordered_json& head, const std::string& list, const Items& items,
                            const JsonOf& json_of) {
  using Json = nlohmann::ordered_json;
  const auto line = [](const Json& j) { return j.dump(-1, ' ', false, Json::error_handler_t::replace); };
  std::string out = line(head);
  out.back() = ',';
  out += "\n\"" + list + "\":[";
  const char* before = "\n";
  for (const auto& item : items) {
    out += before + line(json_of(item));
    before = ",\n";
  }
  return out + "\n]}\n";
}

}  // namespace texmesh
