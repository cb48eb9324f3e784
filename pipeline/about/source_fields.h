#pragma once
#include <span>
#include <string>
#include <string_view>

#include "format/base/note.h"
#include "format/documents/about.h"

namespace texmesh {

/// A stranger's text for a field of about.json: tabs and line ends become blanks, blanks at both ends go,
/// then clean_text().
std::string clean_about_text(const std::string& text, std::size_t max_bytes);

/// A unit of length by its name ("mm", "metre", "feet" ...): the name and its metres. False for others.
bool find_unit(const std::string& name, About& about);

/// Enters the licence, its page, and a note where it is neither SPDX nor a URL: then it stays as text.
void set_source_licence(About& about, const std::string& text, const std::string& place, Notes& notes);

/// Enters what a source file says under one of these names, in any case; a blank, "_" and "-" are equal:
/// title, description, creator | author, licence | license, attribution | credit | copyright,
/// source | source url, identifier, doi, capture | capture method, date | created, unit | units, up | up
/// axis, crs | coordinate reference, epsg. False for any other name. A value that makes no sense costs a
/// note.
bool set_source_field(About& about, std::string_view name, const std::string& value, const std::string& place,
                      Notes& notes);

/// What comment lines say as "name: value", one field a line; others are ignored. `format` is the file's
/// ("obj", "ply"). The lines that gave a field are kept in About::source.
About about_from_comments(std::span<const std::string> comments, const std::string& format, Notes& notes);

/// The comment lines ("# ...") of the first 64 KiB of an OBJ, without the mark.
std::vector<std::string> obj_comments(std::string_view text);

}  // namespace texmesh
