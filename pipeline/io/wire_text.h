#pragma once
#include <cstddef>
#include <string>
#include <string_view>

namespace texmesh {

// File names are bytes, JSON is UTF-8. What is no UTF-8 goes through JSON as U+0001 and the bytes with those
// that are none, U+0001 and backslashes as \xHH; everything else goes as it is.

/// Bytes of the UTF-8 character that a text begins with; 0 where there is none (RFC 3629: shortest forms, no
/// surrogates, up to U+10FFFF). `text` is not empty.
std::size_t utf8_character_bytes(std::string_view text);
bool is_utf8(std::string_view bytes);
/// UTF-8 that from_wire() gives the same bytes for.
std::string to_wire(std::string_view bytes);
std::string from_wire(std::string_view text);
/// For people and for documents that name files: to_wire() without its mark.
std::string readable_name(std::string_view bytes);

}  // namespace texmesh
