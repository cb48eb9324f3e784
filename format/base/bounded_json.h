#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

namespace texmesh {

/// Parses JSON that a stranger wrote: nested at most `max_depth` deep, UTF-8, nothing behind the value.
/// Throws FormatError{document, byte, ...}.
nlohmann::ordered_json parse_bounded_json(std::span<const std::uint8_t> bytes, const std::string& document,
                                          int max_depth = 64);

}  // namespace texmesh
