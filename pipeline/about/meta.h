#pragma once
#include <string>

namespace texmesh {

/// Reads what a curator says about a model (schemas/meta.v1.schema.json): the file of --meta, or `about` of a
/// collection. Strict: InputError{file, place + JSON pointer, ...} for unknown members, wrong types, texts
/// over their limits, a licence that is neither of SPDX nor a URL, and a code that EPSG has not given.
/// Returns the canonical text that the option package.meta holds; "" for an object that says nothing.
std::string read_meta(const std::string& json, const std::string& file, const std::string& place = "");

/// Two such texts, `over` winning field by field. "" is one that says nothing.
std::string merge_meta(const std::string& under, const std::string& over);

/// The axis that such a text says is up, or "".
std::string up_axis_of_meta(const std::string& meta);

}  // namespace texmesh
