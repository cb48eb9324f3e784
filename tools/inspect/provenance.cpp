#include "tools/inspect/provenance.h"

#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "pipeline/compile/options.h"

namespace texmesh {
namespace {

constexpr const char* kDocument = "provenance.json";
constexpr Range kNotEmptyText{1, 1e6};

struct FormatVersion {
  int major = 0, minor = 0;
  static void fields(auto& s, auto&& v) {
    v("major", s.major, Range{0, 65535}, "");
    v("minor", s.minor, Range{0, 65535}, "");
  }
};

}  // namespace

template <>
struct RecordFields<Provenance::Input> {
  static void fields(auto& s, auto&& v) {
    v("role", s.role, FieldRule{.words = "model|file"}, "");
    v("uri", s.uri, kMayMiss, "as the model refers to the file");
    v("sha256", s.sha256, FieldRule{.pattern = "^[0-9a-f]{64}$"}, "");
    v("bytes", s.bytes, Range{0, 9007199254740992.0}, "");
  }
};

namespace {

struct ProvenanceDocument {
  std::string tool;
  FormatVersion format;
  std::vector<Provenance::Input> inputs;
  Json options;
  std::map<std::string, int> stages;
  std::map<std::string, std::string> libraries;
  static void fields(auto& s, auto&& v) {
    v("version", Constant{1}, "");
    v("tool", s.tool, kNotEmptyText, "name and version of what made the package");
    v("format", s.format, "");
    v("inputs", s.inputs, FieldRule{.count = Range{1, 1e6}}, "the model, then the files that it refers to");
    v("options", s.options, "every option, after defaults, as a profile (profile.v1)");
    v("stages", s.stages, Range{0, 1 << 30}, "stage name: version");
    v("libraries", s.libraries, kNotEmptyText, "library that can change bytes: version");
  }
};

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
    auto document = from_json<ProvenanceDocument>(parse_bounded_json(json, kDocument), kDocument);
    check_inputs(document.inputs);
    check_options(document.options);
    Provenance p;
    p.tool = std::move(document.tool);
    p.format_major = document.format.major, p.format_minor = document.format.minor;
    p.inputs = std::move(document.inputs);
    p.options = std::make_shared<const Json>(std::move(document.options));
    p.stages = std::move(document.stages);
    p.libraries = std::move(document.libraries);
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
