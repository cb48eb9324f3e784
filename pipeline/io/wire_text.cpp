#include "pipeline/io/wire_text.h"

#include <fmt/format.h>
#include <utf8proc.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>

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
    // Scans of a gigabyte are ASCII: eight characters at a time.
    for (std::uint64_t eight = 0; bytes.size() >= 8; bytes.remove_prefix(8)) {
      std::memcpy(&eight, bytes.data(), 8);
      if ((eight & 0x8080808080808080u) != 0) break;
    }
    if (bytes.empty()) break;
    const std::size_t n = utf8_character_bytes(bytes);
    if (n == 0) return false;
    bytes.remove_prefix(n);
  }
  return true;
}

void append_utf8(std::string& text, char32_t c) {
  const auto add = [&](char32_t byte) { text += static_cast<char>(byte); };
  if (c < 0x80) return add(c);
  if (c < 0x800) {
    add(0xc0 | c >> 6);
  } else {
    if (c < 0x10000) {
      add(0xe0 | c >> 12);
    } else {
      add(0xf0 | c >> 18);
      add(0x80 | (c >> 12 & 0x3f));
    }
    add(0x80 | (c >> 6 & 0x3f));
  }
  add(0x80 | (c & 0x3f));
}

std::string utf8_of(std::string_view bytes) {
  if (is_utf8(bytes)) return std::string(bytes);
  // Where Windows-1252 differs from Latin-1: 0x80 to 0x9f. What it leaves open stays a control character.
  static constexpr char16_t kFrom0x80[] =
      u"\u20ac\x0081\u201a\u0192\u201e\u2026\u2020\u2021\u02c6\u2030\u0160\u2039\u0152\x008d\u017d\x008f"
      u"\x0090\u2018\u2019\u201c\u201d\u2022\u2013\u2014\u02dc\u2122\u0161\u203a\u0153\x009d\u017e\u0178";
  std::string text;
  text.reserve(bytes.size() + bytes.size() / 8);
  for (const char byte : bytes) {
    const auto c = static_cast<unsigned char>(byte);
    append_utf8(text, c >= 0x80 && c < 0xa0 ? char32_t{kFrom0x80[c - 0x80]} : char32_t{c});
  }
  return text;
}

std::string name_key(std::string_view name) {
  const std::string text = utf8_of(name);
  utf8proc_uint8_t* key = nullptr;
  const auto bytes = utf8proc_map(
      reinterpret_cast<const utf8proc_uint8_t*>(text.data()), static_cast<utf8proc_ssize_t>(text.size()),
      &key, static_cast<utf8proc_option_t>(UTF8PROC_STABLE | UTF8PROC_COMPOSE | UTF8PROC_CASEFOLD));
  const std::unique_ptr<utf8proc_uint8_t, void (*)(void*)> held(key, std::free);
  return bytes < 0 ? text : std::string(reinterpret_cast<const char*>(key), static_cast<std::size_t>(bytes));
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
