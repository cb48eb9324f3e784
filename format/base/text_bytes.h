#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace texmesh {

/// The bytes of a text, which must outlive them.
inline std::span<const std::uint8_t> text_bytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// A stranger's text, fit to be stored and shown: bytes that are not UTF-8 and control characters become
/// '?', and what is longer than `max_bytes` is cut at a character.
std::string clean_text(const std::string& text, std::size_t max_bytes);

}  // namespace texmesh
