#include "pipeline/compile/profile.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "format/base/text_bytes.h"
#include "pipeline/compile/option_fields.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

Json parse_document(std::span<const std::uint8_t> json, std::size_t most_bytes, int most_depth,
                    const std::string& file) {
  if (json.size() > most_bytes)
    throw InputError(file, "", "at most " + std::to_string(most_bytes) + " bytes of JSON",
                     std::to_string(json.size()));
  try {
    return parse_bounded_json(json, file, most_depth);
  } catch (const FormatError& e) {
    throw InputError(file, e.place(), e.expected(), e.found());
  }
}

/// An experiment's result. Title and method are what people write down about it.
struct JndProfile {
  std::string schema, title, method;
  double jnd = 0;
  std::optional<double> reference_px, distance_exponent;
  std::optional<PerceptualStatistic> statistic;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    constexpr FieldRule kText{.range = Range{0, 500}, .may_miss = true};
    v("$schema", s.schema, kMayMiss, "");
    v("version", Constant{1}, "");
    v("title", s.title, kText, "for people: the collection or the kind of object");
    v("method", s.method, kText, "for people: judges, display, light, threshold");
    v("jnd", s.jnd, Range{0.001, 1},
      "just-noticeable change of the distance to the skeleton, relative to it");
    v("reference_px", s.reference_px, Range{1, 100000},
      "displayed height of the object in px at which it was found; 512 by default");
    v("distance_exponent", s.distance_exponent, Range{0, 2},
      "e of the change that is just noticeable at D px: jnd x (reference_px / D)^e; 0, the default of a profile, is the "
      "same at every distance, as the thesis prints");
    v("statistic", s.statistic, "the value of a change of scale that is compared with it; p95 by default");
  }
};

}  // namespace

void read_profile(CompileOptions& options, const std::string& json, const std::string& file_name) {
  apply_profile(options, parse_document(text_bytes(json), 1 << 20, 16, file_name), file_name);
}

void apply_profile(CompileOptions& options, const Json& root, const std::string& file_name) {
  if (!root.is_object()) throw InputError(file_name, "", "an object", root.type_name());
  if (!root.contains("version") || root["version"] != 1)
    throw InputError(file_name, "/version", "1",
                     root.contains("version") ? root["version"].dump() : "nothing");
  std::vector<OptionField> fields = list_options(options);
  for (const auto& [stage, section] : root.items()) {
    if (stage == "version" || stage == "$schema") continue;
    const bool known = std::any_of(fields.begin(), fields.end(),
                                   [&s = stage](const OptionField& f) { return f.stage == s; });
    if (!known) throw InputError(file_name, "/" + stage, "the name of a stage", "\"" + stage + "\"");
    if (!section.is_object()) throw InputError(file_name, "/" + stage, "an object", section.type_name());
    for (const auto& [name, value] : section.items()) {
      const std::string place = "/" + stage + "/" + name;
      OptionField* field = find_option(fields, stage + "." + name);
      if (!field) throw InputError(file_name, place, "an option of " + stage, "\"" + name + "\"");
      set_option_json(*field, value, file_name, place);
    }
  }
  check_options(options, file_name);
}

std::string profile_file(const std::string& wanted) {
  std::error_code error;
  if (wanted.find_first_of("/.") != std::string::npos || fs::exists(wanted, error)) return wanted;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  std::vector<std::string> names;
  for (const char* beside : {"../profiles", "../share/texmesh/profiles"}) {
    const fs::path profiles = (folder / beside).lexically_normal();
    const fs::path file = profiles / (wanted + ".json");
    if (fs::is_regular_file(file, error)) return file.string();
    for (const fs::directory_entry& entry : fs::directory_iterator(profiles, error))
      if (entry.path().extension() == ".json") names.push_back(entry.path().stem().string());
  }
  std::sort(names.begin(), names.end());
  std::string known;
  for (const std::string& name : names) known += (known.empty() ? "" : ", ") + name;
  throw InputError(wanted, "", "a file, or the name of a profile that is installed",
                   known.empty() ? "none" : known);
}

std::string write_profile(const CompileOptions& options) { return profile_json(options).dump(); }

Json profile_json(const CompileOptions& options) {
  CompileOptions copy = options;
  Json root{{"version", 1}};
  for (const OptionField& f : list_options(copy)) root[f.stage][f.name] = option_json(f);
  return root;
}

DocumentSchema profile_schema() {
  CompileOptions defaults;
  Json sections = Json::object();
  for (const OptionField& f : list_options(defaults)) {
    Json& section = sections[f.stage];
    if (section.is_null())
      section = Json{{"type", "object"}, {"additionalProperties", false}, {"properties", Json::object()}};
    section["properties"][f.name] = option_schema(f);
  }
  Json properties{{"$schema", {{"type", "string"}}}, {"version", {{"const", 1}}}};
  for (auto& [stage, section] : sections.items()) properties[stage] = section;
  return document_schema("profile.v1", "texmesh profile, version 1",
                         "Options of texmesh compile, by stage. Generated by `texmesh schema profile.v1`.",
                         {{"type", "object"},
                          {"required", {"version"}},
                          {"additionalProperties", false},
                          {"properties", properties}});
}

void read_jnd_profile(CompileOptions& options, std::span<const std::uint8_t> json, const std::string& file) {
  const auto read = from_json<JndProfile>(parse_document(json, 1 << 16, 4, file), file, true);
  PerceptualValuesOptions& o = options.perceptual_values;
  o.jnd = read.jnd;
  o.jnd_reference_px = read.reference_px.value_or(o.jnd_reference_px);
  o.jnd_distance_exponent = read.distance_exponent.value_or(0);
  o.statistic = read.statistic.value_or(o.statistic);
}

DocumentSchema jnd_profile_schema() {
  return document_schema(
      "jnd-profile.v1", "texmesh JND profile, version 1",
      "What an experiment with judges found to be just noticeable: texmesh compile --jnd-profile FILE. texmesh-lab "
      "experiment fit writes it. Without a profile a relative change of 0.10 x 512 / D holds at a displayed height of D "
      "px, which is a guess (docs/lab/experiments.md).",
      schema_of<JndProfile>());
}

}  // namespace texmesh
