#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace texmesh {

/// The bytes of a text, which must outlive them.
inline std::span<const std::uint8_t> text_bytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// The pieces between separators, one more than there are separators. They are parts of the text.
inline std::vector<std::string_view> pieces_of(std::string_view text, char separator) {
  std::vector<std::string_view> pieces;
  for (std::size_t end; (end = text.find(separator)) != text.npos; text.remove_prefix(end + 1))
    pieces.push_back(text.substr(0, end));
  pieces.push_back(text);
  return pieces;
}

/// "1 triangle", "2 triangles"; `many` is a plural that does not end with an s behind `one`.
inline std::string counted(std::uint64_t n, const std::string& one, const std::string& many = "") {
  return std::to_string(n) + " " + (n == 1 ? one : many.empty() ? one + "s" : many);
}

/// A stranger's text, fit to be stored and shown: bytes that are not UTF-8 and control characters become
/// '?', and what is longer than `max_bytes` is cut at a character.
std::string clean_text(const std::string& text, std::size_t max_bytes);

}  // namespace texmesh
