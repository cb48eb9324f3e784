#pragma once
#include <algorithm>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>

#include "format/base/errors.h"
#include "format/base/json_fields.h"

namespace texmesh {

// JSON documents that a user names. They are read as strictly as a package's (json_fields.h), but what is
// wrong with them is the user's to mend.

/// What `read` returns. Its FormatErrors become InputErrors {file, JSON pointer, ...}.
template <class Read>
auto read_document(const std::string& file, Read&& read) {
  try {
    return std::forward<Read>(read)();
  } catch (const FormatError& e) {
    throw InputError(file, e.place().empty() ? "/" : e.place(), e.expected(), e.found());
  }
}

/// Fails at `at` when the object has a field of another name. What is no object is left to its reader.
inline void check_field_names(const nlohmann::json& object, std::initializer_list<std::string_view> known,
                              const JsonAt& at) {
  if (!object.is_object()) return;
  for (const auto& [name, value] : object.items())
    if (std::ranges::find(known, name) == known.end())
      at.fail("only known fields", "\"" + name.substr(0, 40) + "\"");
}

}  // namespace texmesh
