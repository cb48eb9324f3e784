#pragma once
#include <string>

namespace texmesh {

struct CompileOptions;

/// Reads a profile (schemas/profile.v1.schema.json) over the given options; absent fields keep their values,
/// those that it has count as set by the user. Strict: unknown fields, wrong types and values out of range
/// throw InputError{file_name, JSON pointer, ...}.
void read_profile(CompileOptions& options, const std::string& json, const std::string& file_name);

/// The file of a profile: `wanted` where there is such a file or it has a slash or a dot, else NAME.json of
/// profiles/ beside the executable's folder (a build tree) or of share/texmesh/profiles of an installation.
/// InputError with the names that there are.
std::string profile_file(const std::string& wanted);

/// Every option as a profile. Of resolved options: what provenance records, and what a worker gets.
std::string write_profile(const CompileOptions& options);

/// The JSON schema of profiles, generated from the fields; schemas/profile.v1.schema.json is this text (a
/// test).
std::string profile_schema();

}  // namespace texmesh
