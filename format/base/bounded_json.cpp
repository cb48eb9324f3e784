#include "format/base/bounded_json.h"

#include <nlohmann/json.hpp>

#include "format/base/errors.h"

namespace texmesh {
std::optional<std::size_t> first_bracket_deeper_than(std::span<const std::uint8_t> json, int max_depth) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const std::uint8_t c = json[i];
    if (quoted) {
      if (c == '\\') ++i;
      quoted = c != '"';
    } else if (c == '"') {
      quoted = true;
    } else if (c == '{' || c == '[') {
      if (++depth > max_depth) return i;
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return std::nullopt;
}

nlohmann::ordered_json parse_bounded_json(std::span<const std::uint8_t> bytes, const std::string& document,
                                          int max_depth) {
  using Json = nlohmann::ordered_json;
  if (first_bracket_deeper_than(bytes, max_depth))
    throw FormatError(document, "", "JSON at most " + std::to_string(max_depth) + " levels deep", "more");
  try {
    return Json::parse(bytes.begin(), bytes.end());
  } catch (const nlohmann::json::parse_error& e) {
    throw FormatError(document, "byte " + std::to_string(e.byte), "JSON", "a syntax error");
  } catch (const nlohmann::json::out_of_range&) {
    throw FormatError(document, "", "JSON numbers that fit a double", "a larger one");
  }
}

}  // namespace texmesh
