#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "format/model/model.h"
#include "pipeline/import/import.h"
#include "pipeline/import/named_files.h"

namespace texmesh {

/// The image that a material names (find_file()): probed and appended to model.images (one entry per
/// content), index returned. -1 and a warning "missing-texture" where it is not there, which says where it
/// was looked for, and where a Git LFS pointer, an HTML page, an archive or the like (foreign_file()) is in
/// its place. Content that no allow-listed reader takes throws InputError. A KTX2 becomes a PNG with a note
/// (stages/image/ktx2/read_ktx2.h). Notes say what becomes of colour profiles, CMYK and EXIF orientation.
std::int32_t add_image(Model& model, const NameInModel& name, Resolver& resolver,
                       const std::string& file_name, const std::string& place, const ImportOptions& options);
/// The picture that is named after something: `stem` with any ending of pictures, as find_file() finds it. -1
/// and nothing said where there is none; an image's `name` is the file's.
std::int32_t add_image_of_stem(Model& model, const std::string& stem, Resolver& resolver,
                               const std::string& file_name, const std::string& place,
                               const ImportOptions& options);
/// The texture of a model that has texture coordinates and names no texture: the picture that is named after
/// the model, with the warning "unnamed-texture".
std::int32_t add_unnamed_texture(Model& model, Resolver& resolver, const std::string& file_name,
                                 const std::string& place, const ImportOptions& options);
std::int32_t add_image_bytes(Model& model, std::string name, std::vector<std::uint8_t> bytes,
                             const std::string& file_name, const std::string& place,
                             const ImportOptions& options);

}  // namespace texmesh
