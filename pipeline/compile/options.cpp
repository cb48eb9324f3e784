// Options as generic code sees them: listed from the fields of their structs, as JSON both ways, as schema.
#include "pipeline/compile/options.h"

#include <fmt/ranges.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "format/base/text_bytes.h"
#include "format/container/layout.h"
#include "pipeline/about/source_fields.h"
#include "pipeline/io/names/closest_word.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

void check_rising(const std::vector<int>& list, std::size_t most, const std::string& source, const char* name,
                  const std::string& what) {
  if (list.size() > most)
    throw InputError(source, name, "at most " + std::to_string(most) + " " + what,
                     std::to_string(list.size()));
  const auto fall = std::ranges::adjacent_find(list, std::greater_equal<>());
  if (fall != list.end())
    throw InputError(source, name, "strictly rising " + what,
                     std::to_string(fall[0]) + " before " + std::to_string(fall[1]));
}

void check_meta(const CompileOptions& o, const std::string& source) {
  if (o.package.meta.empty()) return;
  read_meta(o.package.meta, source, "package.meta");
  const std::string up = up_axis_of_meta(o.package.meta);
  if (o.import.up > UpAxis::kKeep && !up.empty() && up != "y")
    throw InputError(source, "package.meta/upAxis", "y, as import.up has it, or no upAxis", up);
}

/// What the curator says of the source's axes wins over the source; in the package y is up then.
void turn_by_meta(CompileOptions& o) {
  const std::string up = up_axis_of_meta(o.package.meta);
  if (o.import.up != UpAxis::kAuto || up.empty()) return;
  o.import.up = up == "x" ? UpAxis::kX : up == "z" ? UpAxis::kZ : UpAxis::kY;
  o.package.meta = merge_meta(o.package.meta, R"({"upAxis":"y"})");
}

template <class T>
constexpr OptionKind kind_of() {
  if constexpr (std::is_enum_v<T>) return OptionKind::kName;
  if constexpr (std::is_same_v<T, bool>) return OptionKind::kSwitch;
  if constexpr (std::is_same_v<T, int>) return OptionKind::kInteger;
  if constexpr (std::is_same_v<T, double>) return OptionKind::kNumber;
  if constexpr (std::is_same_v<T, std::vector<int>>) return OptionKind::kIntegers;
  if constexpr (std::is_same_v<T, std::vector<double>>) return OptionKind::kNumbers;
  return OptionKind::kText;
}

/// Collects the fields of one options struct.
struct FieldCollector {
  std::string stage;
  std::set<std::string>& set_by_user;
  std::vector<OptionField>& out;

  /// `rest`: a Range or none, ProfileOnly or not, the help. By value: a reference to a text has the text's
  /// length in its type, and each field would be compiled on its own.
  template <class T, class... Rest>
  void operator()(const char* name, T& value, Rest... rest) {
    OptionField field;
    field.stage = stage, field.name = name, field.kind = kind_of<T>(), field.set_by_user = &set_by_user;
    (take(field, rest), ...);
    if constexpr (std::is_enum_v<T>) field.words = EnumNames<T>::names;
    const FieldRule rule = rule_of(field);
    field.put = [&value](Json& to) { put_value(to, value); };
    field.put_schema = [rule](Json& to) { texmesh::put_schema<T>(to, rule); };
    field.get = [&value, rule](const Json& from, const RecordPlace& at) { get_value(from, value, rule, at); };
    out.push_back(std::move(field));
  }

 private:
  static void take(OptionField& field, const Range& range) { field.range = range; }
  static void take(OptionField& field, const ProfileOnly&) { field.has_flag = false; }
  static void take(OptionField& field, const char* help) { field.help = help; }

  /// Lists have 1 to 64 elements, texts without a Range 200 bytes.
  static FieldRule rule_of(const OptionField& field) {
    FieldRule rule{.range = field.range, .count = Range{1, 64}};
    if (field.kind == OptionKind::kText && !field.range) rule.range = Range{0, 200};
    return rule;
  }
};

/// Command-line text of a field as JSON: numbers and booleans as they stand, lists by commas, everything else
/// a string.
Json parse_text(const OptionField& field, const std::string& text) {
  auto scalar = [](const std::string& t) {
    Json j = Json::parse(t, nullptr, false);
    return j.is_number() || j.is_boolean() ? j : Json(t);
  };
  if (field.kind == OptionKind::kText) return Json(text);
  if (field.kind == OptionKind::kName) {  // Z and z are one axis
    const std::string_view closest = closest_word(text, field.words);
    return Json(closest.size() == text.size() && ::strcasecmp(text.c_str(), std::string(closest).c_str()) == 0
                    ? std::string(closest)
                    : text);
  }
  if (field.kind != OptionKind::kIntegers && field.kind != OptionKind::kNumbers) return scalar(text);
  Json list = Json::array();
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ',');) list.push_back(scalar(part));
  return list;
}

namespace fs = std::filesystem;

/// An experiment's result. Title and method are what people write down about it.
struct JndProfile {
  std::string schema, title, method;
  double jnd = 0;
  std::optional<double> reference_px, distance_exponent;
  std::optional<PerceptualStatistic> statistic;
  static void fields(auto& s, auto&& v) {
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

/// Whether `part` is `candidate` itself.
template <class T>
bool is_same_object(const T& candidate, const void* part, const std::type_info& type) {
  return &candidate == part && typeid(T) == type;
}

}  // namespace

CompileOptions resolve_options(CompileOptions o) {
  // Of 12 scales of a saxophone and a site with new charts 11 come 2 to 6 % nearer to S_0 than at 1.
  constexpr double kSeamWeightOfNewCharts = 0.1;
  // The coarsest scales have 580 and 410 triangles then. At .05 those of the site deviate too much.
  constexpr double kMaxShiftOfNewCharts = 0.035;
  constexpr int kCoarsestOfNewCharts = 220;
  const auto is_default = [&](const char* path, const auto& value, const auto& fallback) {
    return value == fallback && !o.set_by_user.contains(path);
  };
  if (o.ladder.mode == LadderMode::kProgressive &&
      is_default("fragmentation.min_fragment_px", o.fragmentation.min_fragment_px,
                 FragmentationOptions{}.min_fragment_px))
    o.fragmentation.min_fragment_px = static_cast<int>(kLeastProgressiveSide);
  if ((o.fragmentation.fill == Fill::kNone || o.atlas.mode == AtlasMode::kRebuild) &&
      is_default("ladder.uncovered", o.ladder.uncovered, LadderOptions{}.uncovered))
    o.ladder.uncovered = Uncovered::kKept;
  if (o.atlas.mode == AtlasMode::kRebuild) {
    const SimplificationOptions usual_scales;
    const auto prefer = [&](const char* path, auto& value, const auto& fallback, const auto& wanted) {
      if (is_default(path, value, fallback)) value = wanted;
    };
    SimplificationOptions& scales = o.simplification;
    prefer("simplification.order", scales.order, usual_scales.order, CollapseOrder::kTouching);
    prefer("simplification.seam_weight", scales.seam_weight, usual_scales.seam_weight,
           kSeamWeightOfNewCharts);
    prefer("simplification.max_shift", scales.max_shift, usual_scales.max_shift, kMaxShiftOfNewCharts);
    prefer("simplification.coarsest_vertices", scales.coarsest_vertices, usual_scales.coarsest_vertices,
           kCoarsestOfNewCharts);
    prefer("proxies.mode", o.proxies.mode, ProxiesOptions{}.mode, ProxyMode::kAlways);
  }
  if (!o.package.meta.empty()) o.package.meta = read_meta(o.package.meta, "package.meta");
  turn_by_meta(o);
  const LadderOptions usual;
  if (is_default("ladder.prune", o.ladder.prune, usual.prune))
    o.ladder.prune = is_default("ladder.rungs", o.ladder.rungs, usual.rungs) &&
                     is_default("ladder.normal_rungs", o.ladder.normal_rungs, usual.normal_rungs) &&
                     is_default("ladder.data_rungs", o.ladder.data_rungs, usual.data_rungs) &&
                     is_default("ladder.alpha_rungs", o.ladder.alpha_rungs, usual.alpha_rungs);
  return o;
}

void check_options(const CompileOptions& o, const std::string& source) {
  check_meta(o, source);
  check_rising(o.proxies.sizes, kMaxPackageProxies, source, "proxies.sizes", "sizes");
  check_rising(o.ladder.rungs, 16, source, "ladder.rungs", "qualities");
  check_rising(o.ladder.normal_rungs, 16, source, "ladder.normal_rungs", "qualities");
  check_rising(o.ladder.data_rungs, 16, source, "ladder.data_rungs", "qualities");
  check_rising(o.ladder.alpha_rungs, 16, source, "ladder.alpha_rungs", "qualities");
  if (o.ladder.keep_source && o.atlas.mode == AtlasMode::kRebuild)
    throw InputError(
        source, "atlas.mode",
        "keep or auto with ladder.keep_source, since a package has no place for files of textures "
        "that it does not show",
        "rebuild");
  if (o.lut.quality_min > o.lut.quality_max)
    throw InputError(source, "lut.quality_min", "<= lut.quality_max (" + option_text(o.lut.quality_max) + ")",
                     option_text(o.lut.quality_min));
  if (o.lut.quality_fine < o.lut.quality_coarse)
    throw InputError(source, "lut.quality_fine",
                     ">= lut.quality_coarse (" + option_text(o.lut.quality_coarse) + ")",
                     option_text(o.lut.quality_fine));
  try {
    vqp_weight_sum(o.zim);
  } catch (const StageError& e) {
    throw InputError(source, "zim." + e.place(), e.expected(), e.found());
  }
}

std::vector<OptionField> list_options(CompileOptions& options) {
  std::vector<OptionField> fields;
  CompileOptions::sections(options, [&](const char* stage, auto& section) {
    FieldCollector collect{stage, options.set_by_user, fields};
    std::remove_reference_t<decltype(section)>::fields(section, collect);
  });
  return fields;
}

std::string option_name(const CompileOptions& all, const void* part, const std::type_info& type) {
  std::string found;
  CompileOptions::sections(all, [&](const std::string& name, const auto& section) {
    if (is_same_object(section, part, type)) found = name;
    std::remove_cvref_t<decltype(section)>::fields(section,
                                                   [&](const char* field, const auto& value, auto...) {
                                                     if (is_same_object(value, part, type))
                                                       found = name + "." + field;
                                                   });
  });
  if (found.empty()) throw std::logic_error("not an option");
  return found;
}

OptionField* find_option(std::vector<OptionField>& fields, std::string_view path) {
  const auto it = std::ranges::find(fields, path, &OptionField::path);
  return it == fields.end() ? nullptr : &*it;
}

Json option_json(const OptionField& field) {
  Json json;
  field.put(json);
  return json;
}

std::string option_text(const OptionField& field) { return option_json(field).dump(); }

void set_option_json(OptionField& field, const Json& json, const std::string& file,
                     const std::string& place) {
  field.get(json, RecordPlace{file, nullptr, place});
  field.set_by_user->insert(field.path());
}

void set_option(OptionField& field, const std::string& text, const std::string& source) {
  if (!is_utf8(text)) throw InputError(source, "", "UTF-8", readable_name(text));
  set_option_json(field, parse_text(field, text), source, "");
}

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
    if (std::ranges::find(fields, stage, &OptionField::stage) == fields.end()) {
      std::set<std::string> stages;
      for (const OptionField& f : fields) stages.insert(f.stage);
      throw InputError(file_name, "/" + stage, "the name of a stage",
                       "\"" + stage + "\"" + meant_instead(stage, stages));
    }
    if (!section.is_object()) throw InputError(file_name, "/" + stage, "an object", section.type_name());
    for (const auto& [name, value] : section.items()) {
      const std::string place = "/" + stage + "/" + name;
      OptionField* field = find_option(fields, stage + "." + name);
      if (!field) {
        std::vector<std::string> names;
        for (const OptionField& f : fields)
          if (f.stage == stage) names.push_back(f.name);
        throw InputError(file_name, place, "an option of " + stage,
                         "\"" + name + "\"" + meant_instead(name, names));
      }
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
  throw InputError("--profile", "", fmt::format("a file, or one of {}", fmt::join(names, ", ")),
                   wanted + meant_instead(wanted, names));
}

std::string write_profile(const CompileOptions& options) {
  if (options.atlas.mode != AtlasMode::kAuto) return profile_json(options).dump();
  CompileOptions chosen = options, defaults;
  const std::vector<OptionField> usual = list_options(defaults);
  Json root{{"version", 1}};
  for (std::size_t i = 0; const OptionField& f : list_options(chosen))
    if (Json value = option_json(f);
        value != option_json(usual[i++]) || options.set_by_user.contains(f.path()))
      root[f.stage][f.name] = std::move(value);
  return root.dump();
}

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
    Json& schema = section["properties"][f.name];
    f.put_schema(schema);
    schema["description"] = f.help;
    schema["default"] = option_json(f);
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

void read_jnd_profile(CompileOptions& options, ByteSpan json, const std::string& file) {
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
