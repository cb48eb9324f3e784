#include "tools/inspect/dump/option_changes.h"

#include <map>
#include <nlohmann/json.hpp>

#include "pipeline/compile/option_fields.h"
#include "pipeline/compile/options.h"

namespace texmesh {

std::vector<OptionChange> changed_options(const nlohmann::ordered_json& profile) {
  CompileOptions defaults;
  std::map<std::string, std::string> fallback;
  for (const OptionField& f : list_options(defaults)) fallback[f.path()] = option_text(f);
  std::vector<OptionChange> changes;
  for (const auto& [stage, section] : profile.items()) {
    if (!section.is_object()) continue;
    for (const auto& [name, value] : section.items()) {
      const std::string path = stage + "." + name, text = value.dump();
      const auto it = fallback.find(path);
      if (it == fallback.end() || it->second != text)
        changes.push_back({path, text, it == fallback.end() ? "" : it->second});
    }
  }
  return changes;
}

}  // namespace texmesh
