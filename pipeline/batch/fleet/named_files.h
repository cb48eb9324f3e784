#pragma once
#include <string>
#include <vector>

namespace texmesh {

/// The files beside a model that the model names, sorted, paths that begin with the model's folder: buffers
/// and images of glTF, libraries of OBJ and their textures, textures of PLY, the grid and texture of a range
/// scan. Only what is there. No picture is opened and no mesh read: of OBJ the first MiB is looked through,
/// of the others the part that holds names. A file that is not as it should be names nothing; compiling says
/// why.
std::vector<std::string> named_files(const std::string& model);

}  // namespace texmesh
