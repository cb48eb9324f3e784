#pragma once
#include <cstddef>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "format/base/fields.h"

namespace texmesh {

/// The value of an option as JSON: what keys hold and --explain compares. Doubles have the fewest digits that
/// give the same double back.
std::string option_text(bool value);
std::string option_text(int value);
std::string option_text(double value);
std::string option_text(std::string_view value);
std::string option_text(const std::vector<int>& values);
std::string option_text(const std::vector<double>& values);
inline std::string option_text(const std::string& value) { return option_text(std::string_view(value)); }
template <class E>
requires std::is_enum_v<E> std::string option_text(E value) { return option_text(enum_name(value)); }

/// Labels and texts, in order.
using OptionTexts = std::vector<std::pair<std::string, std::string>>;

/// Adds the texts of every field of an options struct, labelled "section.field".
template <class T>
void append_field_texts(const std::string& section, const T& value, OptionTexts& texts) {
  T::fields(value, [&](const char* field, const auto& v, const auto&...) {
    texts.emplace_back(section + "." + field, option_text(v));
  });
}

}  // namespace texmesh
