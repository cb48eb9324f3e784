#pragma once
#include <cstdint>
#include <span>
#include <string_view>

namespace texmesh {

/// The bytes of a text, which must outlive them.
inline std::span<const std::uint8_t> text_bytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace texmesh
