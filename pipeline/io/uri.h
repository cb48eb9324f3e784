#pragma once
#include <charconv>
#include <cstddef>
#include <optional>

#include "format/base/bytes.h"

namespace texmesh {

// Names of files inside models, and URLs. `file` and `place` say where the name stands, for the message of an
// InputError.

/// Refuses every name that could leave the model's folder or mean something else than a file in it: empty,
/// longer than 4096 bytes, NUL or another control character, backslash, a leading '/', a drive letter or
/// scheme (`c:`, `http:`, `file:`), a ".." component, and names that end in a folder ("a/", "."). Throws
/// InputError.
void check_relative_name(std::string_view name, const std::string& file, const std::string& place);

/// "%41" -> "A", once (a decoded '%' stays); what is no escape stays as it is.
std::string percent_decoded(std::string_view uri);

/// Letter, then letters, digits, '+', '-', '.', then ':' (RFC 3986). Takes drive letters as well.
bool has_scheme(std::string_view name);

/// Scheme, host and port of a URL: "https://museum.example" of "https://museum.example/a?b"; "" for an
/// address without a host.
std::string url_origin(std::string_view url);

/// Bytes as they stand in a URL path; slashes stay.
std::string percent_encoded(const std::string& path);

bool is_data_uri(std::string_view uri);

/// The bytes of "data:[<type>];base64,<text>": padding, alphabet and the unused last bits are checked, as a
/// hostile file must not mean two things. Escapes (%2B) and blanks in the text are as browsers read them.
/// Throws InputError, also for more than max_bytes.
Bytes decode_data_uri(std::string_view uri, std::uint64_t max_bytes, const std::string& file,
                      const std::string& place);

/// The number that a text is and nothing besides.
template <class T>
std::optional<T> whole_number(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

/// ".glb" of "a/Bust.GLB"; "" of a name without an extension, or that begins with its only dot.
std::string lower_ending(std::string_view path);

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
/// Equal for names of one name_key(), and for those that differ besides in the ending of a picture: "T.tif"
/// and "t.png".
std::string similar_key(std::string_view name);
/// UTF-8 that from_wire() gives the same bytes for.
std::string to_wire(std::string_view bytes);
std::string from_wire(std::string_view text);
/// For people and for documents that name files: to_wire() without its mark.
std::string readable_name(std::string_view bytes);

}  // namespace texmesh
