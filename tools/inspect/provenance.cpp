#include "tools/inspect/provenance.h"

#include <map>
#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "format/base/errors.h"
#include "format/base/sha256.h"
#include "pipeline/compile/option_fields.h"
#include "pipeline/compile/options.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kDocument = "provenance.json";

[[noreturn]] void fail_provenance(const std::string& place, const std::string& expected, const Json& found) {
  throw FormatError(kDocument, place, expected, found.is_null() ? "nothing" : found.dump().substr(0, 80));
}

Json member(const Json& object, const char* key) {
  const auto it = object.find(key);
  return it == object.end() ? Json() : *it;
}

std::string text(const Json& object, const char* key, const std::string& place) {
  const Json v = member(object, key);
  if (!v.is_string() || v.get_ref<const std::string&>().empty())
    fail_provenance(place + "/" + key, "a text that is not empty", v);
  return v.get<std::string>();
}

std::uint64_t integer_member(const Json& object, const char* key, const std::string& place,
                             std::uint64_t largest) {
  const Json v = member(object, key);
  if (!v.is_number_unsigned() || v.get<std::uint64_t>() > largest)
    fail_provenance(place + "/" + key, "an integer in 0 .. " + std::to_string(largest), v);
  return v.get<std::uint64_t>();
}

Json object_member(const Json& root, const char* key) {
  Json v = member(root, key);
  if (!v.is_object()) fail_provenance(std::string("/") + key, "an object", v);
  return v;
}

std::vector<Provenance::Input> read_inputs(const Json& root) {
  const Json list = member(root, "inputs");
  if (!list.is_array() || list.empty()) fail_provenance("/inputs", "a list with the model first", list);
  std::vector<Provenance::Input> inputs;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string place = "/inputs/" + std::to_string(i);
    if (!list[i].is_object()) fail_provenance(place, "an object", list[i]);
    Provenance::Input input;
    input.role = text(list[i], "role", place);
    if (input.role != "model" && input.role != "file")
      fail_provenance(place + "/role", "model or file", input.role);
    if ((input.role == "model") != (i == 0))
      fail_provenance(place + "/role", i == 0 ? "model" : "file", input.role);
    if (input.role == "file") input.uri = text(list[i], "uri", place);
    input.sha256 = text(list[i], "sha256", place);
    Sha256 digest;
    if (!from_hex(input.sha256, digest))
      fail_provenance(place + "/sha256", "64 lower-case hexadecimal digits", input.sha256);
    input.bytes = integer_member(list[i], "bytes", place, 1ull << 53);
    inputs.push_back(std::move(input));
  }
  return inputs;
}

Json read_options(const Json& root) {
  Json options = object_member(root, "options");
  if (member(options, "version") != 1) fail_provenance("/options/version", "1", member(options, "version"));
  for (const auto& [stage, section] : options.items())
    if (stage != "version" && !section.is_object())
      fail_provenance("/options/" + stage, "an object", section);
  return options;
}

}  // namespace

Provenance read_provenance(std::span<const std::uint8_t> json) {
  const Json root = parse_bounded_json(json, kDocument);
  if (!root.is_object()) fail_provenance("", "an object", root);
  if (member(root, "version") != 1) fail_provenance("/version", "1", member(root, "version"));
  Provenance p;
  p.tool = text(root, "tool", "");
  const Json format = object_member(root, "format");
  p.format_major = static_cast<int>(integer_member(format, "major", "/format", 65535));
  p.format_minor = static_cast<int>(integer_member(format, "minor", "/format", 65535));
  p.inputs = read_inputs(root);
  p.options = std::make_shared<const Json>(read_options(root));
  const Json stages = object_member(root, "stages"), libraries = object_member(root, "libraries");
  for (const auto& [name, value] : stages.items())
    p.stages.emplace_back(name, static_cast<int>(integer_member(stages, name.c_str(), "/stages", 1u << 30)));
  for (const auto& [name, value] : libraries.items())
    p.libraries.emplace_back(name, text(libraries, name.c_str(), "/libraries"));
  return p;
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
