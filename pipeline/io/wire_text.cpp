#include "pipeline/io/wire_text.h"

#include <fmt/format.h>

#include <cstdint>

namespace texmesh {
namespace {

constexpr char kMark = 1;

std::string escaped(std::string_view bytes) {
  std::string out;
  while (!bytes.empty()) {
    const std::size_t n = utf8_character_bytes(bytes);
    if (n == 0 || bytes[0] == kMark || bytes[0] == '\\')
      out += fmt::format("\\x{:02x}", static_cast<std::uint8_t>(bytes[0]));
    else
      out += bytes.substr(0, n);
    bytes.remove_prefix(n == 0 ? 1 : n);
  }
  return out;
}

int lower_hex_digit(char c) {
  return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

}  // namespace

std::size_t utf8_character_bytes(std::string_view s) {
  const auto at = [&](std::size_t i) {
    return i < s.size() ? static_cast<std::uint8_t>(s[i]) : std::uint8_t{0};
  };
  const auto more = [&](std::size_t i, std::uint8_t lo = 0x80, std::uint8_t hi = 0xbf) {
    return at(i) >= lo && at(i) <= hi;
  };
  const std::uint8_t c = at(0);
  if (c < 0x80) return 1;
  if (c >= 0xc2 && c <= 0xdf) return more(1) ? 2 : 0;
  if (c >= 0xe0 && c <= 0xef) {
    const bool second = more(1, c == 0xe0 ? 0xa0 : 0x80, c == 0xed ? 0x9f : 0xbf);
    return second && more(2) ? 3 : 0;
  }
  if (c >= 0xf0 && c <= 0xf4) {
    const bool second = more(1, c == 0xf0 ? 0x90 : 0x80, c == 0xf4 ? 0x8f : 0xbf);
    return second && more(2) && more(3) ? 4 : 0;
  }
  return 0;
}

bool is_utf8(std::string_view bytes) {
  while (!bytes.empty()) {
    const std::size_t n = utf8_character_bytes(bytes);
    if (n == 0) return false;
    bytes.remove_prefix(n);
  }
  return true;
}

std::string to_wire(std::string_view bytes) {
  if (is_utf8(bytes) && (bytes.empty() || bytes[0] != kMark)) return std::string(bytes);
  return kMark + escaped(bytes);
}

std::string from_wire(std::string_view text) {
  if (text.empty() || text[0] != kMark) return std::string(text);
  std::string out;
  for (std::size_t i = 1; i < text.size(); ++i) {
    const int high = i + 3 < text.size() ? lower_hex_digit(text[i + 2]) : -1,
              low = i + 3 < text.size() ? lower_hex_digit(text[i + 3]) : -1;
    if (text[i] == '\\' && text[i + 1] == 'x' && high >= 0 && low >= 0) {
      out += static_cast<char>(16 * high + low);
      i += 3;
    } else {
      out += text[i];
    }
  }
  return out;
}

std::string readable_name(std::string_view bytes) {
  return is_utf8(bytes) ? std::string(bytes) : escaped(bytes);
}

}  // namespace texmesh
