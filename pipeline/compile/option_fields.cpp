// Options as generic code sees them: listed from the fields of their structs, as JSON both ways, as schema.
#include "pipeline/compile/option_fields.h"

#include <nlohmann/json.hpp>
#include <sstream>

#include "pipeline/io/wire_text.h"

namespace texmesh {
namespace {

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
  if (field.kind == OptionKind::kText || field.kind == OptionKind::kName) return Json(text);
  if (field.kind != OptionKind::kIntegers && field.kind != OptionKind::kNumbers) return scalar(text);
  Json list = Json::array();
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ',');) list.push_back(scalar(part));
  return list;
}

/// Whether `part` is `candidate` itself.
template <class T>
bool is_same_object(const T& candidate, const void* part, const std::type_info& type) {
  return &candidate == part && typeid(T) == type;
}

}  // namespace

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
  const auto it =
      std::find_if(fields.begin(), fields.end(), [&](const OptionField& f) { return f.path() == path; });
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

Json option_schema(const OptionField& field) {
  Json schema;
  field.put_schema(schema);
  schema["description"] = field.help;
  schema["default"] = option_json(field);
  return schema;
}

}  // namespace texmesh
