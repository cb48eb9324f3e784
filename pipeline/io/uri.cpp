#include "pipeline/io/uri.h"

#include <fmt/format.h>
#include <utf8proc.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>

#include "format/base/text_bytes.h"
#include "pipeline/io/names/closest_word.h"

namespace texmesh {
namespace {

constexpr std::size_t kMaxNameBytes = 4096;
constexpr std::string_view kAllowed = "a relative name beneath the model's folder";

/// For messages: hostile names are long and hold control characters.
std::string shown(std::string_view name) {
  std::string s = "\"";
  for (const char c : name.substr(0, 80)) s += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  return s + (name.size() > 80 ? "...\"" : "\"");
}

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

const char* why_refused(std::string_view name) {
  if (name.empty()) return "an empty name";
  if (name.size() > kMaxNameBytes) return "a name of over 4096 bytes";
  for (const char c : name) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return "a control character in";
    if (c == '\\') return "a backslash in";
  }
  if (name[0] == '/') return "the absolute name";
  if (has_scheme(name)) return "a scheme or drive letter in";
  const std::vector<std::string_view> parts = pieces_of(name, '/');
  if (std::ranges::count(parts, "..") > 0) return "\"..\" in";
  if (parts.back().empty() || parts.back() == ".") return "the name of a folder";
  return nullptr;
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

constexpr std::array<std::int8_t, 256> base64_values() {
  std::array<std::int8_t, 256> v{};
  v.fill(-1);
  for (int i = 0; i < 26; ++i) {
    v[static_cast<std::size_t>('A' + i)] = static_cast<std::int8_t>(i);
    v[static_cast<std::size_t>('a' + i)] = static_cast<std::int8_t>(26 + i);
  }
  for (int i = 0; i < 10; ++i) v[static_cast<std::size_t>('0' + i)] = static_cast<std::int8_t>(52 + i);
  v['+'] = 62;
  v['/'] = 63;
  return v;
}

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

}  // namespace

bool has_scheme(std::string_view name) {
  if (name.empty() || !is_letter(name[0])) return false;
  for (const char c : name) {
    if (c == ':') return true;
    if (!is_letter(c) && !(c >= '0' && c <= '9') && c != '+' && c != '-' && c != '.') return false;
  }
  return false;
}

void check_relative_name(std::string_view name, const std::string& file, const std::string& place) {
  if (const char* why = why_refused(name)) {
    throw InputError(file, place, std::string(kAllowed),
                     name.empty() ? std::string(why) : why + (" " + shown(name)));
  }
}

std::string percent_decoded(std::string_view uri) {
  std::string name;
  name.reserve(uri.size());
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const int hi = uri[i] == '%' && i + 2 < uri.size() ? hex_digit(uri[i + 1]) : -1;
    const int lo = hi >= 0 ? hex_digit(uri[i + 2]) : -1;
    name += lo >= 0 ? static_cast<char>(hi * 16 + lo) : uri[i];
    if (lo >= 0) i += 2;
  }
  return name;
}

std::string url_origin(std::string_view url) {
  const std::size_t scheme = url.find("://");
  return scheme == std::string_view::npos ? ""
                                          : std::string(url.substr(0, url.find_first_of("/?#", scheme + 3)));
}

std::string percent_encoded(const std::string& path) {
  static constexpr char kHex[] = "0123456789ABCDEF";
  std::string out;
  for (const char c : path) {
    const auto u = static_cast<unsigned char>(c);
    const bool plain = (u >= '0' && u <= '9') || (u >= 'A' && u <= 'Z') || (u >= 'a' && u <= 'z') ||
                       std::string_view("-._~/").find(c) != std::string_view::npos;
    if (plain)
      out += c;
    else
      out += {'%', kHex[u >> 4], kHex[u & 15]};
  }
  return out;
}

bool is_data_uri(std::string_view uri) {
  return uri.size() > 4 && uri[4] == ':' &&
         std::ranges::equal(uri.substr(0, 4), std::string_view("data"), {}, [](char c) { return c | 0x20; });
}

Bytes decode_data_uri(std::string_view uri, std::uint64_t max_bytes, const std::string& file,
                      const std::string& place) {
  static constexpr std::array<std::int8_t, 256> kValues = base64_values();
  const std::size_t comma = uri.find(',');
  constexpr std::string_view kMark = ";base64";
  if (!is_data_uri(uri) || comma == std::string_view::npos || comma < kMark.size() ||
      uri.substr(comma - kMark.size(), kMark.size()) != kMark) {
    throw InputError(file, place, "data:<type>;base64,<data>", shown(uri));
  }
  std::string_view text = uri.substr(comma + 1);
  std::string plain;
  if (text.find_first_of("% \t\r\n") != std::string_view::npos) {
    plain = percent_decoded(text);
    std::erase_if(plain, [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; });
    text = plain;
  }
  const std::size_t padded = text.size();
  while (!text.empty() && text.back() == '=' && padded - text.size() < 2) text.remove_suffix(1);
  // Unpadded text is accepted (RFC 4648, section 3.2; several exporters leave the padding out).
  if (text.size() % 4 == 1 || (padded != text.size() && padded % 4 != 0)) {
    throw InputError(file, place, "whole base64 groups", std::to_string(padded) + " characters");
  }
  const std::uint64_t size = text.size() / 4 * 3 + (text.size() % 4 ? text.size() % 4 - 1 : 0);
  if (size > max_bytes) {
    throw InputError(file, place, "<= " + std::to_string(max_bytes) + " bytes", std::to_string(size));
  }
  Bytes bytes;
  bytes.reserve(size);
  std::uint32_t bits = 0;
  int held = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const int v = kValues[static_cast<unsigned char>(text[i])];
    if (v < 0) throw InputError(file, place, "a base64 digit", "another character at " + std::to_string(i));
    bits = bits << 6 | static_cast<std::uint32_t>(v);
    held += 6;
    if (held >= 8) {
      held -= 8;
      bytes.push_back(static_cast<std::uint8_t>(bits >> held));
      bits &= (1u << held) - 1;
    }
  }
  if (bits != 0) throw InputError(file, place, "zero in the unused last bits of base64", "other bits");
  return bytes;
}

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

std::string similar_key(std::string_view name) {
  static constexpr std::string_view kPictures[] = {".jpg", ".jpeg", ".png", ".webp", ".avif",
                                                   ".tif", ".tiff", ".bmp", ".tga",  ".gif",
                                                   ".exr", ".hdr",  ".dds", ".jp2",  ".ktx2"};
  const std::string ending = lower_ending(name);
  const bool is_picture =
      std::find(std::begin(kPictures), std::end(kPictures), ending) != std::end(kPictures);
  return is_picture ? name_key(name.substr(0, name.size() - ending.size())) + ".*" : name_key(name);
}

std::string lower_ending(std::string_view path) {
  path.remove_prefix(path.rfind('/') + 1);
  const std::size_t dot = path.rfind('.');
  return in_lower_case(std::string(dot == 0 || dot == path.npos ? "" : path.substr(dot)));
}

std::string to_wire(std::string_view bytes) {
  if (is_utf8(bytes) && (bytes.empty() || bytes[0] != kMark)) return std::string(bytes);
  return kMark + escaped(bytes);
}

std::string from_wire(std::string_view text) {
  if (text.empty() || text[0] != kMark) return std::string(text);
  std::string out;
  for (std::size_t i = 1; i < text.size(); ++i) {
    const int high = i + 3 < text.size() ? hex_digit(text[i + 2]) : -1,
              low = i + 3 < text.size() ? hex_digit(text[i + 3]) : -1;
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
