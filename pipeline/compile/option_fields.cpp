#include "pipeline/compile/option_fields.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>
#include <type_traits>

#include "format/base/errors.h"
#include "pipeline/compile/option_json.h"
#include "pipeline/compile/options.h"
#include "pipeline/graph/option_text.h"
#include "pipeline/io/wire_text.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

/// Collects the fields of one options struct.
struct FieldCollector {
  std::string stage;
  std::set<std::string>& set_by_user;
  std::vector<OptionField>& out;

  template <class T>
  void operator()(const char* name, T& value, Range range, const char* help) {
    out.push_back({stage, name, help, range, &value, &set_by_user});
  }
  template <class T>
  void operator()(const char* name, T& value, const char* help) {
    if constexpr (std::is_enum_v<T>) {
      EnumField e{EnumNames<T>::names, [&value] { return static_cast<std::size_t>(value); },
                  [&value](std::size_t i) { value = static_cast<T>(i); }};
      out.push_back({stage, name, help, std::nullopt, std::move(e), &set_by_user});
    } else {
      out.push_back({stage, name, help, std::nullopt, &value, &set_by_user});
    }
  }
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

std::string option_text(const OptionField& field) {
  if (const auto* e = std::get_if<EnumField>(&field.value)) return option_text(e->names[e->get()]);
  return std::visit(
      [](const auto& value) {
        if constexpr (std::is_same_v<std::decay_t<decltype(value)>, EnumField>)
          return std::string();
        else
          return option_text(*value);
      },
      field.value);
}

void set_option(OptionField& field, const std::string& text, const std::string& source) {
  if (!is_utf8(text)) throw InputError(source, "", "UTF-8", readable_name(text));
  set_option_json(field, parse_text(field, text), source, "");
}

}  // namespace texmesh
