#pragma once
#include <stdexcept>
#include <string>
#include <type_traits>

#include "pipeline/compile/options.h"
#include "pipeline/graph/make_stage.h"

namespace texmesh {

/// The name of a part of `all`: "ssf" of a section, "ladder.mode" of a field. Throws std::logic_error for
/// what is no part of it.
template <class T>
std::string option_name(const CompileOptions& all, const T& part) {
  const auto is_part = [&part](const auto& candidate) {
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(candidate)>, T>)
      return &candidate == &part;
    else
      return false;
  };
  std::string found;
  CompileOptions::sections(all, [&](const std::string& name, const auto& section) {
    if (is_part(section)) found = name;
    std::remove_cvref_t<decltype(section)>::fields(section,
                                                   [&](const char* field, const auto& value, auto&&...) {
                                                     if (is_part(value)) found = name + "." + field;
                                                   });
  });
  if (found.empty()) throw std::logic_error("not an option");
  return found;
}

/// Declares what a stage reads of `all`: whole sections or single fields, as they stand there.
template <class... T>
Options<T...> read_of(const CompileOptions& all, const T&... parts) {
  return options(OptionValue<T>(option_name(all, parts), parts)...);
}

}  // namespace texmesh
