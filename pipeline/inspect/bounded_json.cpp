#include "pipeline/inspect/bounded_json.h"

#include "format/errors.h"

namespace texmesh {

nlohmann::ordered_json parse_bounded_json(std::span<const std::uint8_t> bytes, const std::string& document,
                                          int max_depth) {
  using Json = nlohmann::ordered_json;
  const auto limit_depth = [&](int depth, Json::parse_event_t, Json&) {
    if (depth > max_depth)
      throw FormatError(document, "", "JSON at most " + std::to_string(max_depth) + " levels deep", "more");
    return true;
  };
  try {
    return Json::parse(bytes.begin(), bytes.end(), limit_depth);
  } catch (const nlohmann::json::parse_error& e) {
    throw FormatError(document, "byte " + std::to_string(e.byte), "JSON", "a syntax error");
  } catch (const nlohmann::json::out_of_range&) {
    throw FormatError(document, "", "JSON numbers that fit a double", "a larger one");
  }
}

}  // namespace texmesh
