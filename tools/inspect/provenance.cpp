#include "tools/inspect/provenance.h"

#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "pipeline/compile/options.h"

namespace texmesh {
namespace {

constexpr const char* kDocument = "provenance.json";
[[noreturn]] void fail_provenance(const std::string& place, const std::string& expected, const Json& found) {
  throw FormatError(kDocument, place, expected, found.is_null() ? "nothing" : found.dump().substr(0, 80));
}

void check_inputs(const std::vector<Provenance::Input>& inputs) {
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const std::string place = "/inputs/" + std::to_string(i);
    const char* role = i == 0 ? "model" : "file";
    if (inputs[i].role != role) fail_provenance(place + "/role", role, inputs[i].role);
    if (i > 0 && inputs[i].uri.empty()) fail_provenance(place + "/uri", "a text that is not empty", Json());
    Sha256 digest;
    if (!from_hex(inputs[i].sha256, digest))
      fail_provenance(place + "/sha256", "64 lower-case hexadecimal digits", inputs[i].sha256);
  }
}

void check_options(const Json& options) {
  if (!options.is_object()) fail_provenance("/options", "an object", options);
  for (const auto& [stage, section] : options.items())
    if (stage != "version" && !section.is_object())
      fail_provenance("/options/" + stage, "an object", section);
  if (options.value("version", Json()) != 1) fail_provenance("/options/version", "1", Json());
}

}  // namespace

Provenance read_provenance(std::span<const std::uint8_t> json) {
  try {
    auto p = from_json<Provenance>(parse_bounded_json(json, kDocument), kDocument);
    check_inputs(p.inputs);
    check_options(*p.options);
    return p;
  } catch (const InputError& e) {  // the package is to blame
    throw FormatError(e.file(), e.place(), e.expected(), e.found());
  }
}

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
