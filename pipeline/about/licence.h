#pragma once
#include <cstdint>
#include <string>

namespace texmesh {

/// What a text says of a licence.
struct Licence {
  enum class Kind : std::uint8_t { kSpdx, kUrl, kOther };
  Kind kind = Kind::kOther;
  std::string text;   // SPDX: identifiers spelled as the list spells them
  std::string url;    // where the licence can be read; "" = not known
  std::string wrong;  // kOther: the part of an expression that is no identifier, or ""
};

/// An SPDX licence expression (identifiers, "+", WITH, AND, OR, brackets, LicenseRef-...) in any case, an
/// http or https URL, or anything else. "CC-BY-4.0 (https://...)", as Sketchfab writes it, is the identifier
/// and its URL.
Licence read_licence(const std::string& text);

/// Whether EPSG has given the code to a coordinate reference system.
bool is_epsg_code(std::uint64_t code);

}  // namespace texmesh
