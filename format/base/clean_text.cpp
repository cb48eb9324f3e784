#include "format/base/clean_text.h"

#include <cstdint>

namespace texmesh {

std::string clean_text(const std::string& text, std::size_t max_bytes) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const auto at = [&](std::size_t k) {
      return i + k < text.size() ? static_cast<std::uint8_t>(text[i + k]) : 0u;
    };
    const unsigned c = at(0);
    const std::size_t length = c < 0x80                ? 1
                               : c >= 0xc2 && c < 0xe0 ? 2
                               : c >= 0xe0 && c < 0xf0 ? 3
                               : c >= 0xf0 && c < 0xf5 ? 4
                                                       : 0;
    bool good = length > 0 && (c >= 0x20 && c != 0x7f);
    for (std::size_t k = 1; k < length; ++k) good = good && (at(k) & 0xc0) == 0x80;
    // Overlong forms, surrogates and numbers past U+10FFFF show in the second byte.
    good = good && !(c == 0xe0 && at(1) < 0xa0) && !(c == 0xed && at(1) > 0x9f) &&
           !(c == 0xf0 && at(1) < 0x90) && !(c == 0xf4 && at(1) > 0x8f);
    const std::string part = good ? text.substr(i, length) : "?";
    if (out.size() + part.size() > max_bytes) break;
    out += part;
    i += good ? length : 1;
  }
  return out;
}

}  // namespace texmesh
