#include "pipeline/compile/options.h"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <sstream>
#include <type_traits>

#include "format/base/errors.h"
#include "pipeline/io/wire_text.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

/// Collects the fields of one options struct.
struct FieldCollector {
  std::string stage;
  std::vector<OptionField>& out;

  template <class T>
  void operator()(const char* name, T& value, Range range, const char* help) {
    out.push_back({stage, name, help, range, &value});
  }
  template <class T>
  void operator()(const char* name, T& value, const char* help) {
    if constexpr (std::is_enum_v<T>) {
      EnumField e{EnumNames<T>::names, [&value] { return static_cast<std::size_t>(value); },
                  [&value](std::size_t i) { value = static_cast<T>(i); }};
      out.push_back({stage, name, help, std::nullopt, std::move(e)});
    } else {
      out.push_back({stage, name, help, std::nullopt, &value});
    }
  }
};

template <class... F>
struct Overload : F... {
  using F::operator()...;
};
template <class... F>
Overload(F...) -> Overload<F...>;

std::string joined(std::span<const std::string_view> names) {
  std::string s;
  for (std::string_view n : names) s += (s.empty() ? "" : ", ") + std::string(n);
  return s;
}

std::string number_text(double v) { return Json(v).dump(); }

std::string range_text(const Range& r, const char* kind) {
  return std::string(kind) + " in " + number_text(r.lo) + " .. " + number_text(r.hi);
}

Json to_json(const OptionField& f) {
  return std::visit(Overload{[](const EnumField& e) { return Json(e.names[e.get()]); },
                             [](const auto* value) { return Json(*value); }},
                    f.value);
}

/// Reads JSON values into fields and says what was wrong where.
class FieldReader {
 public:
  FieldReader(std::string file, std::string place) : file_(std::move(file)), place_(std::move(place)) {}

  void read(OptionField& field, const Json& json) const {
    std::visit(
        Overload{
            [&](bool* v) { *v = json.is_boolean() ? json.get<bool>() : fail<bool>("true or false", json); },
            [&](int* v) { *v = static_cast<int>(integer(json, *field.range)); },
            [&](double* v) { *v = number(json, *field.range); },
            [&](std::string* v) {
              if (!json.is_string() || json.get_ref<const std::string&>().size() > 200)
                fail<int>("a text of at most 200 bytes", json);
              *v = json.get<std::string>();
            },
            [&](std::vector<int>* v) {
              *v = list<int>(json, [&](const Json& x) { return static_cast<int>(integer(x, *field.range)); });
            },
            [&](std::vector<double>* v) {
              *v = list<double>(json, [&](const Json& x) { return number(x, *field.range); });
            },
            [&](EnumField& e) { enumerator(e, json); },
        },
        field.value);
  }

 private:
  template <class T>
  T fail(std::string expected, const Json& found) const {
    throw InputError(file_, place_, std::move(expected), found.dump().substr(0, 80));
  }
  double number(const Json& json, const Range& range) const {
    if (!json.is_number() || !(json.get<double>() >= range.lo && json.get<double>() <= range.hi))
      return fail<double>(range_text(range, "a number"), json);
    return json.get<double>();
  }
  double integer(const Json& json, const Range& range) const {
    if (!json.is_number_integer() || !(json.get<double>() >= range.lo && json.get<double>() <= range.hi))
      return fail<double>(range_text(range, "an integer"), json);
    return json.get<double>();
  }
  template <class T, class F>
  std::vector<T> list(const Json& json, F&& element) const {
    if (!json.is_array() || json.empty() || json.size() > 64)
      return fail<std::vector<T>>("a list of 1 to 64 numbers", json);
    std::vector<T> v;
    for (const Json& x : json) v.push_back(element(x));
    return v;
  }
  void enumerator(EnumField& e, const Json& json) const {
    if (json.is_string())
      for (std::size_t i = 0; i < e.names.size(); ++i)
        if (e.names[i] == json.get_ref<const std::string&>()) return e.set(i);
    fail<int>("one of " + joined(e.names), json);
  }
  std::string file_, place_;
};

/// Command-line text of a field as JSON: numbers and booleans as they stand, lists by commas, everything else
/// a string.
Json parse_text(const OptionField& field, const std::string& text) {
  auto scalar = [](const std::string& t) {
    Json j = Json::parse(t, nullptr, false);
    return j.is_number() || j.is_boolean() ? j : Json(t);
  };
  const bool is_list = std::holds_alternative<std::vector<int>*>(field.value) ||
                       std::holds_alternative<std::vector<double>*>(field.value);
  if (!is_list) {
    const bool is_text =
        std::holds_alternative<std::string*>(field.value) || std::holds_alternative<EnumField>(field.value);
    return is_text ? Json(text) : scalar(text);
  }
  Json list = Json::array();
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ',');) list.push_back(scalar(part));
  return list;
}

int json_depth(const std::string& text) {
  int depth = 0, deepest = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      if (c == '\\')
        ++i;
      else if (c == '"')
        quoted = false;
    } else if (c == '"') {
      quoted = true;
    } else if (c == '{' || c == '[') {
      deepest = std::max(deepest, ++depth);
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return deepest;
}

Json parse_profile_text(const std::string& json, const std::string& file_name) {
  if (json.size() > 1 << 20)
    throw InputError(file_name, "", "at most 1 MiB", std::to_string(json.size()) + " bytes");
  if (json_depth(json) > 16) throw InputError(file_name, "", "JSON at most 16 levels deep", "more");
  try {
    return Json::parse(json);
  } catch (const nlohmann::json::parse_error& e) {
    throw InputError(file_name, "byte " + std::to_string(e.byte), "JSON", "a syntax error");
  }
}

Json field_schema(const OptionField& f) {
  Json s = Json::object();
  auto numeric = [&](const char* type) {
    Json n{{"type", type}};
    auto bound = [type](double v) {
      return type == std::string("integer") ? Json(static_cast<std::int64_t>(v)) : Json(v);
    };
    n["minimum"] = bound(f.range->lo);
    n["maximum"] = bound(f.range->hi);
    return n;
  };
  auto list_of = [&](const char* type) {
    return Json{{"type", "array"}, {"minItems", 1}, {"maxItems", 64}, {"items", numeric(type)}};
  };
  std::visit(Overload{
                 [&](const bool*) { s["type"] = "boolean"; },
                 [&](const int*) { s = numeric("integer"); },
                 [&](const double*) { s = numeric("number"); },
                 [&](const std::string*) {
                   s = Json{{"type", "string"}, {"maxLength", 200}};
                 },
                 [&](const std::vector<int>*) { s = list_of("integer"); },
                 [&](const std::vector<double>*) { s = list_of("number"); },
                 [&](const EnumField& e) {
                   s = Json{{"enum", Json(std::vector<std::string>(e.names.begin(), e.names.end()))}};
                 },
             },
             f.value);
  s["description"] = f.help;
  s["default"] = to_json(f);
  return s;
}

void check_rungs(const std::vector<int>& rungs, const std::string& source, const char* name) {
  if (rungs.size() > 16) throw InputError(source, name, "at most 16 qualities", std::to_string(rungs.size()));
  for (std::size_t i = 1; i < rungs.size(); ++i)
    if (rungs[i] <= rungs[i - 1])
      throw InputError(source, name, "strictly rising qualities",
                       std::to_string(rungs[i - 1]) + " before " + std::to_string(rungs[i]));
}

}  // namespace

std::vector<OptionField> list_options(CompileOptions& options) {
  std::vector<OptionField> fields;
  CompileOptions::sections(options, [&](const char* stage, auto& section) {
    FieldCollector collect{stage, fields};
    std::remove_reference_t<decltype(section)>::fields(section, collect);
  });
  return fields;
}

std::string option_text(const OptionField& field) { return to_json(field).dump(); }

void set_option(OptionField& field, const std::string& text, const std::string& source) {
  if (!is_utf8(text)) throw InputError(source, "", "UTF-8", readable_name(text));
  FieldReader(source, "").read(field, parse_text(field, text));
}

void read_profile(CompileOptions& options, const std::string& json, const std::string& file_name) {
  const Json root = parse_profile_text(json, file_name);
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
      auto field = std::find_if(fields.begin(), fields.end(), [&s = stage, &n = name](const OptionField& f) {
        return f.stage == s && f.name == n;
      });
      if (field == fields.end())
        throw InputError(file_name, place, "an option of " + stage, "\"" + name + "\"");
      FieldReader(file_name, place).read(*field, value);
    }
  }
  check_options(options, file_name);
}

std::string write_profile(const CompileOptions& options) {
  CompileOptions copy = options;
  Json root{{"version", 1}};
  for (const OptionField& f : list_options(copy)) root[f.stage][f.name] = to_json(f);
  return root.dump();
}

std::string profile_schema() {
  CompileOptions defaults;
  Json sections = Json::object();
  for (const OptionField& f : list_options(defaults)) {
    Json& section = sections[f.stage];
    if (section.is_null())
      section = Json{{"type", "object"}, {"additionalProperties", false}, {"properties", Json::object()}};
    section["properties"][f.name] = field_schema(f);
  }
  Json properties{{"$schema", {{"type", "string"}}}, {"version", {{"const", 1}}}};
  for (auto& [stage, section] : sections.items()) properties[stage] = section;
  const Json root{{"$schema", "http://json-schema.org/draft-07/schema#"},
                  {"title", "texmesh profile, version 1"},
                  {"description",
                   "Options of texmesh compile, by stage. Generated by `texmesh stages --profile-schema`."},
                  {"type", "object"},
                  {"required", {"version"}},
                  {"additionalProperties", false},
                  {"properties", properties}};
  return root.dump(2) + "\n";
}

void check_options(const CompileOptions& o, const std::string& source) {
  check_rungs(o.ladder.rungs, source, "ladder.rungs");
  check_rungs(o.ladder.normal_rungs, source, "ladder.normal_rungs");
  check_rungs(o.ladder.data_rungs, source, "ladder.data_rungs");
  check_rungs(o.ladder.alpha_rungs, source, "ladder.alpha_rungs");
  if (o.lut.quality_min > o.lut.quality_max)
    throw InputError(source, "lut.quality_min", "<= lut.quality_max (" + number_text(o.lut.quality_max) + ")",
                     number_text(o.lut.quality_min));
  if (o.lut.quality_fine < o.lut.quality_coarse)
    throw InputError(source, "lut.quality_fine",
                     ">= lut.quality_coarse (" + number_text(o.lut.quality_coarse) + ")",
                     number_text(o.lut.quality_fine));
  if (!(o.zim.weight_eta + o.zim.weight_z + o.zim.weight_i + o.zim.weight_m > 0))
    throw InputError(source, "zim.weight_eta", "> 0, or weight_z, weight_i or weight_m > 0",
                     number_text(o.zim.weight_eta));
}

}  // namespace texmesh
