#pragma once
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>

namespace texmesh {

/// The byte of the first bracket outside of strings that nests deeper than `max_depth`; nothing when there is
/// none. Up to the first syntax error, where a parser ends, brackets are counted as the parser counts them.
/// (A parser callback would do, but with one nlohmann's parser goes over an array's elements again after
/// each: minutes for a collection of 100,000 models.)
std::optional<std::size_t> first_bracket_deeper_than(std::span<const std::uint8_t> json, int max_depth);

/// Parses JSON that a stranger wrote: nested at most `max_depth` deep, UTF-8, nothing behind the value.
/// Throws FormatError{document, byte, ...}.
nlohmann::ordered_json parse_bounded_json(std::span<const std::uint8_t> bytes, const std::string& document,
                                          int max_depth = 64);

}  // namespace texmesh
