#include "pipeline/batch/depfile.h"

#include "format/errors.h"

namespace texmesh {
namespace {

/// What both accept (GNU make 4.3, Ninja 1.11): "\ " for a blank, "\#", "$$"; everything else as it is.
std::string escaped(const std::string& path) {
  std::string out;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const char c = path[i];
    if (c == '\n' || c == '\r')
      throw InputError(path, "", "a path without line breaks (dependency files cannot hold them)",
                       "one with them");
    if ((c == ' ' || c == '#') && i > 0 && path[i - 1] == '\\')
      throw InputError(path, "",
                       "a path without a backslash before a blank or # (dependency files cannot hold it)",
                       "one with it");
    if (c == ' ' || c == '#') out += '\\';
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
