#pragma once
#include "format/base/note.h"
#include "format/documents/annotations.h"
#include "pipeline/import/import.h"

namespace texmesh {

/// Notes as PackageOptions::annotations has them, as a package has them: turned as the mesh of `source` was,
/// and moved from the source's coordinates to those of meshes at `origin`, unless they are there already.
/// Those outside `box`, the bounds of the meshes, cost a warning. "" stays "".
std::string placed_annotations(const std::string& json, const About& source, UpAxis up, Vec3d origin,
                               const Box3d& box, Notes& notes);

}  // namespace texmesh
