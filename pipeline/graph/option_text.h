#pragma once
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "pipeline/io/record.h"

namespace texmesh {

/// The value of an option as JSON: what keys hold and --explain compares. Doubles have the fewest digits that
/// give the same double back.
template <class T>
requires(!std::is_class_v<T> || std::is_same_v<T, std::string> || record_detail::IsList<T>::value) std::string
    option_text(const T& value) {
  return to_json_line(value);
}

/// Labels and texts, in order.
using OptionTexts = std::vector<std::pair<std::string, std::string>>;

/// Adds the texts of every field of an options struct, labelled "section.field".
template <class T>
void append_field_texts(const std::string& section, const T& value, OptionTexts& texts) {
  T::fields(value, [&](const char* field, const auto& v, auto...) {
    texts.emplace_back(section + "." + field, option_text(v));
  });
}

}  // namespace texmesh
