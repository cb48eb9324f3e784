#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

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
/// hostile file must not mean two things. Throws InputError, also for more than max_bytes.
std::vector<std::uint8_t> decode_data_uri(std::string_view uri, std::uint64_t max_bytes,
                                          const std::string& file, const std::string& place);

}  // namespace texmesh
