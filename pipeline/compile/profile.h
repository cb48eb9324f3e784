#pragma once
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

#include "pipeline/io/record.h"

namespace texmesh {

struct CompileOptions;

/// Reads a profile (schemas/profile.v1.schema.json) over the given options; absent fields keep their values,
/// those that it has count as set by the user. Strict: unknown fields, wrong types and values out of range
/// throw InputError{file_name, JSON pointer, ...}.
void read_profile(CompileOptions& options, const std::string& json, const std::string& file_name);
/// The same for a profile that is parsed already.
void apply_profile(CompileOptions& options, const Json& profile, const std::string& file_name);

/// The file of a profile: `wanted` where there is such a file or it has a slash or a dot, else NAME.json of
/// profiles/ beside the executable's folder (a build tree) or of share/texmesh/profiles of an installation.
/// InputError with the names that there are.
std::string profile_file(const std::string& wanted);

/// Every option as a profile. Of resolved options: what provenance records, and what a worker gets.
std::string write_profile(const CompileOptions& options);
Json profile_json(const CompileOptions& options);

/// The JSON schema of profiles, generated from the fields: profile.v1.
DocumentSchema profile_schema();

/// Reads a JND profile (schemas/jnd-profile.v1.schema.json): what an experiment with judges found to be just
/// noticeable, and under which conditions. Its numbers become the options perceptual_values.jnd,
/// .jnd_reference_px, .jnd_distance_exponent and .statistic, so they are in keys and provenance and the file
/// itself is not. Absent ones keep their values, but for the exponent: a profile that says nothing of
/// distance holds at every distance (0), as the thesis prints. Strict: an unknown field, a wrong type, a
/// value out of range is an InputError {file, JSON pointer, ...}; then no option has changed.
void read_jnd_profile(CompileOptions& options, std::span<const std::uint8_t> json, const std::string& file);

/// jnd-profile.v1.
DocumentSchema jnd_profile_schema();

}  // namespace texmesh
