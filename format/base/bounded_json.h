#pragma once
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>

namespace texmesh {

/// How deep and how large a JSON text is, told without parsing it. Up to the first syntax error, where a
/// parser ends, brackets are counted as the parser counts them.
struct JsonShape {
  /// The byte of the first bracket outside of strings that nests deeper than allowed. The count ends there.
  std::optional<std::size_t> too_deep;
  std::uint64_t values = 0;  // brackets that open and commas: at least the number of values but one
};
/// (A parser callback would do, but with one nlohmann's parser goes over an array's elements again after
/// each: minutes for a collection of 100,000 models.)
JsonShape scan_json_shape(std::span<const std::uint8_t> json, int max_depth);

/// JsonShape's `values` of what was parsed: fewer than of the text where an object names a member twice.
template <class AnyJson>
std::uint64_t values_in(const AnyJson& value) {
  if (!value.is_structured()) return 0;
  std::uint64_t sum = value.size() > 1 ? value.size() : 1;
  for (const AnyJson& child : value) sum += values_in(child);
  return sum;
}

/// Parses JSON that a stranger wrote: nested at most `max_depth` deep, UTF-8, nothing behind the value.
/// Throws FormatError{document, byte, ...}. `values`: those of the text.
nlohmann::ordered_json parse_bounded_json(std::span<const std::uint8_t> bytes, const std::string& document,
                                          int max_depth = 64, std::uint64_t* values = nullptr);

/// The first name that an object of this JSON has twice. It takes longer than parsing.
std::optional<std::string> repeated_name(std::span<const std::uint8_t> json);

}  // namespace texmesh
