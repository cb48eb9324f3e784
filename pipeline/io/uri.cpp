#include "pipeline/io/uri.h"

#include <algorithm>
#include <array>

#include "format/base/errors.h"

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
  std::string_view last;
  for (std::size_t at = 0; at <= name.size();) {
    const std::size_t end = std::min(name.find('/', at), name.size());
    last = name.substr(at, end - at);
    if (last == "..") return "\"..\" in";
    at = end + 1;
  }
  if (last.empty() || last == ".") return "the name of a folder";
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
  if (uri.size() < 5) return false;
  for (std::size_t i = 0; i < 4; ++i) {
    if ((uri[i] | 0x20) != "data"[i]) return false;
  }
  return uri[4] == ':';
}

std::vector<std::uint8_t> decode_data_uri(std::string_view uri, std::uint64_t max_bytes,
                                          const std::string& file, const std::string& place) {
  static constexpr std::array<std::int8_t, 256> kValues = base64_values();
  const std::size_t comma = uri.find(',');
  constexpr std::string_view kMark = ";base64";
  if (!is_data_uri(uri) || comma == std::string_view::npos || comma < kMark.size() ||
      uri.substr(comma - kMark.size(), kMark.size()) != kMark) {
    throw InputError(file, place, "data:<type>;base64,<data>", shown(uri));
  }
  std::string_view text = uri.substr(comma + 1);
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
  std::vector<std::uint8_t> bytes;
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

}  // namespace texmesh
