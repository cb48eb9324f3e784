#include "format/base/bounded_json.h"

#include "format/base/errors.h"

namespace texmesh {
namespace {

/// Whether brackets nest deeper than this outside of strings. Up to the first syntax error, where the parser
/// ends, this sees what the parser sees. (A parser callback would do, but with one nlohmann's parser goes
/// over an array's elements again after each: minutes for a collection of 100,000 models.)
bool is_deeper(std::span<const std::uint8_t> json, int max_depth) {
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
      if (++depth > max_depth) return true;
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return false;
}

}  // namespace

nlohmann::ordered_json parse_bounded_json(std::span<const std::uint8_t> bytes, const std::string& document,
                                          int max_depth) {
  using Json = nlohmann::ordered_json;
  if (is_deeper(bytes, max_depth))
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
