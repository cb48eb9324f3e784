#include "pipeline/compile/jnd_profile.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "format/base/errors.h"
#include "pipeline/compile/option_fields.h"
#include "pipeline/compile/options.h"
#include "pipeline/compile/user_document.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxBytes = 1 << 16, kMaxText = 500;

struct ProfileField {
  const char *name, *option;
};
constexpr ProfileField kFields[]{{"jnd", "perceptual_values.jnd"},
                                 {"reference_px", "perceptual_values.jnd_reference_px"},
                                 {"distance_exponent", "perceptual_values.jnd_distance_exponent"},
                                 {"statistic", "perceptual_values.statistic"}};

Json parse(std::span<const std::uint8_t> json, const std::string& file) {
  if (json.size() > kMaxBytes)
    throw InputError(file, "", "at most " + std::to_string(kMaxBytes) + " bytes of JSON",
                     std::to_string(json.size()));
  return read_document(file, [&] { return parse_bounded_json(json, file, 4); });
}

/// What people write down about an experiment; it changes nothing.
void check_text(const Json& value, const std::string& file, const std::string& place) {
  if (!value.is_string() || value.get_ref<const std::string&>().size() > kMaxText)
    throw InputError(file, place, "a text of at most " + std::to_string(kMaxText) + " bytes",
                     value.dump().substr(0, 60));
}

void set_field(CompileOptions& options, const ProfileField& field, const Json& value,
               const std::string& file) {
  const std::string place = std::string("/") + field.name;
  std::vector<OptionField> fields = list_options(options);
  OptionField* option = find_option(fields, field.option);
  const bool is_text = std::holds_alternative<EnumField>(option->value);
  if (is_text ? !value.is_string() : !value.is_number())
    throw InputError(file, place, is_text ? "a text" : "a number", value.dump().substr(0, 60));
  try {
    set_option(*option, is_text ? value.get<std::string>() : value.dump(), file);
  } catch (const InputError& e) {
    throw InputError(file, place, e.expected(), e.found());
  }
}

}  // namespace

void read_jnd_profile(CompileOptions& options, std::span<const std::uint8_t> json, const std::string& file) {
  const Json root = parse(json, file);
  if (!root.is_object()) throw InputError(file, "/", "an object", root.type_name());
  for (const char* name : {"version", "jnd"})
    if (!root.contains(name)) throw InputError(file, std::string("/") + name, "a value", "none");
  if (root["version"] != 1) throw InputError(file, "/version", "1", root["version"].dump().substr(0, 60));
  CompileOptions changed = options;
  changed.perceptual_values.jnd_distance_exponent = 0;
  for (const auto& [name, value] : root.items()) {
    if (name == "version" || name == "$schema") continue;
    const auto* field = std::find_if(std::begin(kFields), std::end(kFields),
                                     [&n = name](const ProfileField& f) { return n == f.name; });
    if (field != std::end(kFields))
      set_field(changed, *field, value, file);
    else if (name == "title" || name == "method")
      check_text(value, file, "/" + name);
    else
      throw InputError(file, "/" + name.substr(0, 60), "only known fields", "another one");
  }
  options = std::move(changed);
}

}  // namespace texmesh
