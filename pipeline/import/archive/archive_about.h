#pragma once
#include "format/base/note.h"
#include "format/documents/about.h"
#include "pipeline/import/archive/archive_files.h"

namespace texmesh {

/// What an archive says of its model beside it: Sketchfab's license.txt (title, author, source, licence,
/// credit), and of OpenDroneMap's textured models metres, z as up axis, and the coordinate reference that
/// coords.txt or proj.txt names. `model`: the model's name in the archive.
About archive_about(ArchiveFiles& archive, const std::string& model, Notes& notes);

}  // namespace texmesh
