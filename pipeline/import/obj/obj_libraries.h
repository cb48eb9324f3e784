#pragma once
#include <string>

#include "format/model/model.h"
#include "pipeline/import/import.h"
#include "pipeline/import/obj/obj_reader.h"

namespace texmesh {

/// Adds a material to the model for each name in data.materials, in order, from the libraries that the file
/// names. What is missing gives a warning and a material without texture.
void add_obj_materials(const ObjData& data, const std::string& file, Model& model, Resolver& resolver,
                       const ImportOptions& options);

}  // namespace texmesh
