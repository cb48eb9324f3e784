#include "format/base/bounded_json.h"

#include <nlohmann/json.hpp>

#include "format/base/errors.h"

namespace texmesh {

JsonShape scan_json_shape(std::span<const std::uint8_t> json, int max_depth) {
  JsonShape shape;
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
      ++shape.values;
      if (++depth > max_depth) {
        shape.too_deep = i;
        return shape;
      }
    } else if (c == '}' || c == ']') {
      --depth;
    } else if (c == ',') {
      ++shape.values;
    }
  }
  return shape;
}

nlohmann::ordered_json parse_bounded_json(std::span<const std::uint8_t> bytes, const std::string& document,
                                          int max_depth) {
  using Json = nlohmann::ordered_json;
  if (scan_json_shape(bytes, max_depth).too_deep)
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
