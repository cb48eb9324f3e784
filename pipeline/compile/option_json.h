#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "pipeline/compile/option_fields.h"

namespace texmesh {

/// A field's value.
nlohmann::ordered_json option_json(const OptionField& field);

/// Sets a field. Strict: a wrong type or a value out of range throws InputError{file, place, ...}.
void set_option_json(OptionField& field, const nlohmann::ordered_json& json, const std::string& file,
                     const std::string& place);

/// What a schema says of a field: type, range, help, default.
nlohmann::ordered_json option_schema(const OptionField& field);

}  // namespace texmesh
