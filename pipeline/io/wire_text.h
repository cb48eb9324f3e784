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
/// UTF-8 as it is; bytes that are none count as Windows-1252, which Latin-1 is a part of.
std::string utf8_of(std::string_view bytes);
/// Appends a character's UTF-8.
void append_utf8(std::string& text, char32_t character);
/// Equal for names that differ only in the case of letters, in how Unicode composes them (NFC, NFD), or in
/// being written in Windows-1252 instead of UTF-8.
std::string name_key(std::string_view name);
/// UTF-8 that from_wire() gives the same bytes for.
std::string to_wire(std::string_view bytes);
std::string from_wire(std::string_view text);
/// For people and for documents that name files: to_wire() without its mark.
std::string readable_name(std::string_view bytes);

}  // namespace texmesh
