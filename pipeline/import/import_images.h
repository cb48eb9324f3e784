#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "format/model/model.h"
#include "pipeline/import/import.h"

namespace texmesh {

/// How the file of a finer scale names a picture of its package: "../preview/PPP.jpg". The one name that
/// leaves the model's folder. Resolvers of packages and import_file() know it; FileResolver refuses it as any
/// other.
bool is_preview_uri(const std::string& uri);

/// Bytes of an image a material refers to: probed and appended to model.images (one entry per uri), index
/// returned; -1 and a warning "missing-texture" when it is not there. Content that no allow-listed reader
/// takes throws InputError. A KTX2 becomes a PNG with a note (stages/image/ktx2/read_ktx2.h). Notes say what
/// becomes of colour profiles, CMYK and EXIF orientation.
std::int32_t add_image(Model& model, const std::string& uri, Resolver& resolver, const std::string& file_name,
                       const std::string& place, const ImportOptions& options);
std::int32_t add_image_bytes(Model& model, std::string name, std::vector<std::uint8_t> bytes,
                             const std::string& file_name, const std::string& place,
                             const ImportOptions& options);

}  // namespace texmesh
