#pragma once
#include <cstdint>
#include <span>
#include <string>

namespace texmesh {

struct CompileOptions;

/// Reads a JND profile (schemas/jnd-profile.v1.schema.json): what an experiment with judges found to be just
/// noticeable, and under which conditions. Its numbers become the options perceptual_values.jnd,
/// .jnd_reference_px, .jnd_distance_exponent and .statistic, so they are in keys and provenance and the file
/// itself is not. Absent ones keep their values, but for the exponent: a profile that says nothing of
/// distance holds at every distance (0), as the thesis prints. Strict: an unknown field, a wrong type, a
/// value out of range is an InputError {file, JSON pointer, ...}; then no option has changed.
void read_jnd_profile(CompileOptions& options, std::span<const std::uint8_t> json, const std::string& file);

}  // namespace texmesh
