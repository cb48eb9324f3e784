#pragma once
#include <string>

#include "format/model/model.h"
#include "pipeline/import/import.h"

namespace texmesh {

/// Last step of every reader: drops triangles that refer to non-finite positions or UVs (warnings
/// "non-finite-position", "non-finite-uv": such UVs become 0), unused images and materials; sets part names;
/// checks the limits; throws InputError when no triangle is left.
void finish_model(Model& model, const std::string& file_name, const ImportOptions& options);

}  // namespace texmesh
