#pragma once
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <typeinfo>
#include <vector>

#include "pipeline/compile/options.h"
#include "pipeline/graph/make_stage.h"
#include "pipeline/io/record.h"

namespace texmesh {

enum class OptionKind : std::uint8_t { kSwitch, kInteger, kNumber, kText, kIntegers, kNumbers, kName };

/// One option as generic code sees it. The functions reach into the CompileOptions that list_options was
/// given.
struct OptionField {
  std::string stage, name, help;
  std::optional<Range> range;
  bool has_flag = true;  // false: profiles alone may set it (ProfileOnly)
  OptionKind kind = OptionKind::kText;
  std::span<const std::string_view> words;  // kName: one of these
  std::function<void(Json&to)> put, put_schema;
  std::function<void(const Json& from, const RecordPlace& at)> get;
  std::set<std::string>* set_by_user = nullptr;  // of the same CompileOptions; set_option() adds the path
  std::string path() const { return stage + "." + name; }
};
std::vector<OptionField> list_options(CompileOptions& options);

/// The field with this path, or null.
OptionField* find_option(std::vector<OptionField>& fields, std::string_view path);

/// A field's value as JSON, and its text: what keys, provenance and --explain compare.
Json option_json(const OptionField& field);
std::string option_text(const OptionField& field);

/// Sets a field. Strict: a wrong type or a value out of range throws InputError{file, place, ...}.
void set_option_json(OptionField& field, const Json& json, const std::string& file, const std::string& place);
/// Sets a field from text as given on a command line ("20", "draco", "5,8,11"). InputError names the flag.
void set_option(OptionField& field, const std::string& text, const std::string& source);

/// What a schema says of a field: type, range, help, default.
Json option_schema(const OptionField& field);

/// The name of a part of `all`: "ssf" of a section, "ladder.mode" of a field. Throws std::logic_error for
/// what is no part of it. The type tells a section from its first field, which stands at the same place.
std::string option_name(const CompileOptions& all, const void* part, const std::type_info& type);
template <class T>
std::string option_name(const CompileOptions& all, const T& part) {
  return option_name(all, &part, typeid(T));
}

/// Declares what a stage reads of `all`: whole sections or single fields, as they stand there.
template <class... T>
Options<T...> read_of(const CompileOptions& all, const T&... parts) {
  return options(OptionValue<T>(option_name(all, parts), parts)...);
}

}  // namespace texmesh
