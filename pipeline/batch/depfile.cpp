#include "pipeline/batch/depfile.h"

#include <string_view>

#include "format/base/errors.h"

namespace texmesh {
namespace {

// What one of them takes for something else, or Ninja for the end of a path, and nothing can prevent it.
constexpr std::string_view kNotForBoth = ";|=%*?'&\t\n\r";

/// What both accept (GNU make 4.3, Ninja 1.11): "\ " for a blank, "\#", "\:", "$$"; everything else as it is.
std::string escaped(const std::string& path) {
  std::string out;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const char c = path[i];
    if (kNotForBoth.find(c) != std::string_view::npos)
      throw InputError(
          path, "",
          "a path without ; | = % * ? ' & tabs and line breaks (no dependency file holds them for "
          "both make and Ninja)",
          c < ' ' ? "one with a control character" : std::string("one with ") + c);
    if ((c == ' ' || c == '#' || c == ':') && i > 0 && path[i - 1] == '\\')
      throw InputError(path, "",
                       "a path without a backslash before a blank, # or : (dependency files cannot hold it)",
                       "one with it");
    if (c == ' ' || c == '#' || c == ':') out += '\\';
    if (c == '$') out += '$';
    out += c;
  }
  return out;
}

}  // namespace

std::string write_depfile(const std::string& target, const std::vector<std::string>& dependencies) {
  std::string text = escaped(target) + ":";
  for (const std::string& d : dependencies) text += " \\\n  " + escaped(d);
  text += "\n";
  for (const std::string& d : dependencies) text += "\n" + escaped(d) + ":\n";
  return text;
}

}  // namespace texmesh
