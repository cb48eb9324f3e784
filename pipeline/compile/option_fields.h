#pragma once
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "format/base/fields.h"

namespace texmesh {

struct CompileOptions;

/// A field whose C++ type is an enum, seen as text.
struct EnumField {
  std::span<const std::string_view> names;
  std::function<std::size_t()> get;
  std::function<void(std::size_t)> set;
};

/// One option as generic code sees it. Pointers lead into the CompileOptions that list_options was given.
struct OptionField {
  std::string stage, name, help;
  std::optional<Range> range;
  std::variant<bool*, int*, double*, std::string*, std::vector<int>*, std::vector<double>*, EnumField> value;
  std::set<std::string>* set_by_user = nullptr;  // of the same CompileOptions; set_option() adds the path
  std::string path() const { return stage + "." + name; }
};
std::vector<OptionField> list_options(CompileOptions& options);

/// The field with this path, or null.
OptionField* find_option(std::vector<OptionField>& fields, std::string_view path);

/// Text of a field's value as JSON: what keys, provenance and --explain compare.
std::string option_text(const OptionField& field);

/// Sets a field from text as given on a command line ("20", "draco", "5,8,11"). InputError names the flag.
void set_option(OptionField& field, const std::string& text, const std::string& source);

}  // namespace texmesh
