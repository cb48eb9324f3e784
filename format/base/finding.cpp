#include "format/base/finding.h"

namespace texmesh {

std::string to_string(const Finding& f) {
  std::string s = f.entry;
  const auto add = [&s](const char* separator, const std::string& text) {
    if (text.empty()) return;
    if (!s.empty()) s += separator;
    s += text;
  };
  add(": ", f.field);
  add(": expected ", f.expected);
  add(f.expected.empty() ? ": found " : ", found ", f.found);
  s += " [" + f.check + "]";
  return f.rule.empty() ? s : s + " [" + f.rule + "]";
}

}  // namespace texmesh
