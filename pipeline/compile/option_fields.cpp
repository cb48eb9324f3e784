// Options as generic code sees them: listed from the fields of their structs, as JSON both ways, as schema.
#include "pipeline/compile/option_fields.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "format/base/errors.h"
#include "pipeline/graph/option_text.h"
#include "pipeline/io/record.h"
#include "pipeline/io/wire_text.h"

namespace texmesh {
namespace {

/// Collects the fields of one options struct.
struct FieldCollector {
  std::string stage;
  std::set<std::string>& set_by_user;
  std::vector<OptionField>& out;

  template <class T>
  void add(const char* name, T& value, std::optional<Range> range, bool has_flag, const char* help) {
    OptionField field{stage, name, help, range, has_flag, static_cast<int*>(nullptr), &set_by_user};
    if constexpr (std::is_enum_v<T>)
      field.value = EnumField{EnumNames<T>::names, [&value] { return static_cast<std::size_t>(value); },
                              [&value](std::size_t i) { value = static_cast<T>(i); }};
    else
      field.value = &value;
    out.push_back(std::move(field));
  }
  template <class T>
  void operator()(const char* name, T& value, const char* help) {
    add(name, value, std::nullopt, true, help);
  }
  template <class T>
  void operator()(const char* name, T& value, Range range, const char* help) {
    add(name, value, range, true, help);
  }
  template <class T>
  void operator()(const char* name, T& value, ProfileOnly, const char* help) {
    add(name, value, std::nullopt, false, help);
  }
  template <class T>
  void operator()(const char* name, T& value, Range range, ProfileOnly, const char* help) {
    add(name, value, range, false, help);
  }
};

template <class T>
constexpr bool kIsList = std::is_same_v<T, std::vector<int>> || std::is_same_v<T, std::vector<double>>;

/// What a document may hold: lists have 1 to 64 elements, texts without a Range 200 bytes.
template <class T>
FieldRule rule_of(const OptionField& field, const T*) {
  FieldRule rule{.range = field.range};
  if (kIsList<T>) rule.count = Range{1, 64};
  if (std::is_same_v<T, std::string> && !field.range) rule.range = Range{0, 200};
  return rule;
}

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

}  // namespace

std::vector<OptionField> list_options(CompileOptions& options) {
  std::vector<OptionField> fields;
  CompileOptions::sections(options, [&](const char* stage, auto& section) {
    FieldCollector collect{stage, options.set_by_user, fields};
    std::remove_reference_t<decltype(section)>::fields(section, collect);
  });
  return fields;
}

OptionField* find_option(std::vector<OptionField>& fields, std::string_view path) {
  const auto it =
      std::find_if(fields.begin(), fields.end(), [&](const OptionField& f) { return f.path() == path; });
  return it == fields.end() ? nullptr : &*it;
}

Json option_json(const OptionField& field) {
  return std::visit(
      [](const auto& value) {
        if constexpr (std::is_same_v<std::decay_t<decltype(value)>, EnumField>)
          return Json(value.names[value.get()]);
        else
          return Json(*value);
      },
      field.value);
}

std::string option_text(const OptionField& field) { return option_json(field).dump(); }

void set_option_json(OptionField& field, const Json& json, const std::string& file,
                     const std::string& place) {
  const RecordPlace at{file, nullptr, place};
  std::visit(
      [&](auto& value) {
        if constexpr (std::is_same_v<std::decay_t<decltype(value)>, EnumField>)
          value.set(record_detail::get_enum(json, value.names, at));
        else
          get_value(json, *value, rule_of(field, value), at);
      },
      field.value);
  field.set_by_user->insert(field.path());
}

void set_option(OptionField& field, const std::string& text, const std::string& source) {
  if (!is_utf8(text)) throw InputError(source, "", "UTF-8", readable_name(text));
  set_option_json(field, parse_text(field, text), source, "");
}

Json option_schema(const OptionField& field) {
  Json schema = Json::object();
  std::visit(
      [&](const auto& value) {
        if constexpr (std::is_same_v<std::decay_t<decltype(value)>, EnumField>)
          record_detail::schema_of_enum(schema, value.names);
        else
          put_schema<std::remove_pointer_t<std::decay_t<decltype(value)>>>(schema, rule_of(field, value));
      },
      field.value);
  schema["description"] = field.help;
  schema["default"] = option_json(field);
  return schema;
}

}  // namespace texmesh
