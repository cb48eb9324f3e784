#pragma once

#include "format/base/note.h"
#include "format/documents/about.h"

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

/// A stranger's text for a field of about.json: tabs and line ends become blanks, blanks at both ends go,
/// then clean_text().
std::string clean_about_text(const std::string& text, std::size_t max_bytes);

/// Adds such a text to a list of about.json, unless the list has it already or is full.
void add_about_value(std::vector<NamedText>& list, const std::string& name, const std::string& value);

/// A unit of length by its name ("mm", "metre", "feet" ...): the name and its metres. False for others.
bool find_unit(const std::string& name, About& about);

/// Enters the licence, its page, and a note where it is neither SPDX nor a URL: then it stays as text.
void set_source_licence(About& about, const std::string& text, const std::string& place, Notes& notes);

/// Enters what a source file says under one of these names, in any case; a blank, "_" and "-" are equal:
/// title, description, creator | author, licence | license, attribution | credit | copyright,
/// source | source url, identifier, doi, capture | capture method, date | created, unit | units, up | up
/// axis, crs | coordinate reference, epsg. False for any other name. A value that makes no sense costs a
/// note. "N. N. (https://...)", as Sketchfab writes its authors, is the creator and, as an identifier, the
/// creator's page.
bool set_source_field(About& about, std::string_view name, const std::string& value, const std::string& place,
                      Notes& notes);

/// What comment lines say as "name: value", one field a line; others are ignored. `format` is the file's
/// ("obj", "ply"). The lines that gave a field are kept in About::source.
About about_from_comments(std::span<const std::string> comments, const std::string& format, Notes& notes);

/// The comment lines ("# ...") of the first 64 KiB of an OBJ, without the mark.
std::vector<std::string> obj_comments(std::string_view text);

/// Reads what a curator says about a model (schemas/meta.v1.schema.json): the file of --meta, or `about` of a
/// collection. Strict: InputError{file, place + JSON pointer, ...} for unknown members, wrong types, texts
/// over their limits, a licence that is neither of SPDX nor a URL, and a code that EPSG has not given.
/// Returns the canonical text that the option package.meta holds; "" for an object that says nothing.
std::string read_meta(const std::string& json, const std::string& file, const std::string& place = "");

/// Two such texts, `over` winning field by field. "" is one that says nothing.
std::string merge_meta(const std::string& under, const std::string& over);

/// The axis that such a text says is up, or "".
std::string up_axis_of_meta(const std::string& meta);

}  // namespace texmesh
