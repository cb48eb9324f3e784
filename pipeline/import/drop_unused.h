#pragma once
#include <cstddef>
#include <string>

#include "format/model/model.h"

namespace texmesh {

// What no triangle needs leaves a model; indices follow.

/// Positions and wedges, with a note.
void drop_unused_vertices(Model& model);
void drop_unused_materials(Model& model);
void drop_unused_parts(Mesh& mesh);
/// After drop_unused_materials. InputError when a material refers to an image that is not there.
void drop_unused_images(Model& model, const std::string& file_name);

/// "1 vertex", "2 vertices".
std::string count_of(std::size_t n, const char* one, const char* many);

}  // namespace texmesh
