#include "pipeline/io/markup.h"

#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

std::string escaped_character(char c) {
  switch (c) {
    case '&':
      return "&amp;";
    case '<':
      return "&lt;";
    case '>':
      return "&gt;";
    case '"':
      return "&quot;";
    case '\'':
      return "&#39;";
    case '\n':
      return "&#10;";
    case '\t':
      return "&#9;";
    default:
      return static_cast<unsigned char>(c) < 0x20 ? "?" : std::string(1, c);
  }
}

}  // namespace

std::string markup_escaped(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t n = utf8_character_bytes(text);
    if (n == 0)
      out += "\xef\xbf\xbd";  // U+FFFD
    else if (n > 1)
      out += text.substr(0, n);
    else
      out += escaped_character(text[0]);
    text.remove_prefix(n == 0 ? 1 : n);
  }
  return out;
}

std::string page_beginning(std::string_view title, std::string_view policy, std::string_view language) {
  std::string out = "<html lang=\"" + markup_escaped(language) + R"(">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
)";
  if (!policy.empty())
    out += "<meta http-equiv=\"Content-Security-Policy\" content=\"" + std::string(policy) + "\">\n";
  return out + "<title>" + markup_escaped(title) + "</title>\n";
}

}  // namespace texmesh
