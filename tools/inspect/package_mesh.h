#pragma once

#include "delivery/cpp/package/package_reader.h"
#include "pipeline/import/import.h"

namespace texmesh {

/// Whether `path` is a package (a .texmesh file, or a folder that unpack made) and not a model.
bool is_package(const std::string& path);

/// S_0 of a package as its GLB has it; the images are previews. Errors as import_package_glb().
ImportedModel finest_scale(PackageReader& package, const RunContext& context);

/// The full-size plane of a package that an image of finest_scale() stands for, colours before alpha; -1 =
/// none. `name`: Image::name, the last part of "texture/<image>" or "../preview/<plane>.jpg".
std::int32_t plane_of_image(const std::vector<TextureInfo>& textures, const std::string& name);

}  // namespace texmesh
