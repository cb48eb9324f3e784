#pragma once
#include <string>

namespace texmesh {

/// Text as it may stand in an element of HTML or XML, or in an attribute between quotes. Control characters,
/// most of which XML 1.0 cannot write, become question marks; line feeds and tabs stay, as references. Bytes
/// that are no UTF-8 (a file name may hold any) become U+FFFD.
std::string markup_escaped(std::string_view text);

/// The beginning of a page of HTML behind its first line, up to the title: what else its head holds follows.
/// `title` is escaped here; `policy` is its Content-Security-Policy, "" for none.
std::string page_beginning(std::string_view title, std::string_view policy, std::string_view language = "en");

}  // namespace texmesh
