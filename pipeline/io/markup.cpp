#include "pipeline/io/markup.h"

#include <algorithm>

#include "pipeline/io/wire_text.h"

namespace texmesh {

std::string markup_escaped(std::string_view text) {
  std::string sound, out;
  while (!text.empty()) {
    const std::size_t n = utf8_bytes(text);
    sound += n == 0 ? std::string_view("\xef\xbf\xbd") : text.substr(0, n);
    text.remove_prefix(std::max<std::size_t>(n, 1));
  }
  for (const char c : sound) switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      case '\n':
        out += "&#10;";
        break;
      case '\t':
        out += "&#9;";
        break;
      default:
        out += static_cast<unsigned char>(c) < 0x20 ? '?' : c;
    }
  return out;
}

std::string page_beginning(std::string_view title, std::string_view policy) {
  std::string out = R"(<html lang="en">
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
