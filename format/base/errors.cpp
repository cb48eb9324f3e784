#include "format/base/errors.h"

#include <algorithm>
#include <string_view>
#include <utility>

namespace texmesh {
namespace {

std::string joined(std::string_view file, std::string_view place, std::string_view expected,
                   std::string_view found) {
  std::string s;
  auto add = [&s](std::string_view separator, std::string_view prefix, std::string_view text) {
    if (text.empty()) return;
    if (!s.empty()) s += separator;
    s.append(prefix).append(text);
  };
  add(": ", "", file);
  add(": ", "", place);
  std::ranges::replace(s, '\n', '?');  // the name of a file cannot pretend to be another message
  add(": ", "expected ", expected);
  add(expected.empty() ? ": " : ", ", expected.empty() ? "" : "found ", found);
  return s;
}

}  // namespace

Error::Error(std::string file, std::string place, std::string expected, std::string found)
    : std::runtime_error(joined(file, place, expected, found)),
      file_(std::move(file)),
      place_(std::move(place)),
      expected_(std::move(expected)),
      found_(std::move(found)) {}

}  // namespace texmesh
