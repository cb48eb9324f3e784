#pragma once
#include "format/base/note.h"
#include "format/documents/about.h"
#include "pipeline/import/archive/archive_files.h"

namespace texmesh {

/// What an archive says of its model beside it: Sketchfab's license.txt (title, author, source, licence,
/// credit), and of OpenDroneMap's textured models metres, z as up axis, and the coordinate reference that
/// coords.txt or proj.txt names. `model`: the model's name in the archive.
About archive_about(ArchiveFiles& archive, const std::string& model, Notes& notes);

/// The archive's file of notes, by name and bytes: annotations.json, else Voyager's NAME.svx.json, the least
/// deep. Nothing where it has none. InputError where it cannot be unpacked.
std::optional<std::pair<std::string, Bytes>> archived_annotations(ArchiveFiles& archive);

}  // namespace texmesh
