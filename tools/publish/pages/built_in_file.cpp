#include "tools/publish/pages/built_in_file.h"

#include <stdexcept>

namespace texmesh {

std::string filled(std::string_view text, const TemplateValues& values) {
  std::string out;
  for (;;) {
    const std::size_t begin = text.find("{{"), end = text.find("}}", begin);
    if (begin == std::string_view::npos || end == std::string_view::npos) break;
    const std::string_view name = text.substr(begin + 2, end - begin - 2);
    const auto value = values.find(name);
    if (value == values.end()) throw std::logic_error("a page asks for {{" + std::string(name) + "}}");
    out += text.substr(0, begin);
    out += value->second;
    text.remove_prefix(end + 2);
  }
  return out += text;
}

}  // namespace texmesh
