#pragma once
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace texmesh {

/// A file of a room's page/, as the build puts it into the program.
struct BuiltInFile {
  std::string_view name, text;
};

/// Values by their names; what is HTML already, and what was escaped.
using TemplateValues = std::map<std::string, std::string, std::less<>>;
/// `text` with the value of NAME in the place of every {{NAME}}. A value is not looked into, whatever it
/// holds. std::logic_error for a name without a value.
std::string filled(std::string_view text, const TemplateValues& values);

}  // namespace texmesh
