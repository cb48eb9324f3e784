#pragma once
// A scale of a package as a file, a file as a model, and files for programs that know no extension.
#include <nlohmann/json.hpp>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/bytes.h"
#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "tools/extract/glb/standalone_glb.h"

namespace texmesh {

/// The normals of a scale that the vertex-split stream alone has. kFitted: so that it is lit as S_0 is, which
/// takes the whole stream. kStreamed: S_0's, as the stream's prefix of the scale has them.
enum class StreamedNormals : std::uint8_t { kFitted, kStreamed };

/// A scale as one file with the previews in it, wherever the package has the scale. A scale of the stream
/// gets materials, images and node names of the coarsest scale's GLB, and that file's mesh codec. InputError
/// for a scale that is not there; FormatError when the package is damaged. Same result for any thread count.
StandaloneGlb scale_file(PackageReader& package, int scale, const RunContext& context,
                         StreamedNormals normals = StreamedNormals::kFitted);

/// The mesh and materials of a file. Its images become single texels, all different (import makes equal ones
/// one), named by image_name() of their source image.
Model read_model(StandaloneGlb file, const std::string& entry, const RunContext& context);

/// As import names "texture/<image>": without the folder.
std::string image_name(std::uint32_t image);

/// Multiplies the mesh's texture coordinates by the scale that KHR_texture_transform gives all textures of
/// the materials, and takes the extension out of the document, whose `mesh` this is. False, and nothing
/// changes, where textures differ, or where there is more than a scale.
bool bake_texture_scale(nlohmann::ordered_json& root, Mesh& mesh);

/// The same model for programs that know glTF 2.0 and no extension of it that compresses: floats instead of
/// KHR_draco_mesh_compression, EXT_meshopt_compression and KHR_mesh_quantization, PNG instead of WebP,
/// no KHR_texture_transform where it is one scale. Parts
/// and materials stay; tangents go, and the feature ids of merged parts. Of a file without levels of detail
/// and before move_to(). Same bytes for any thread count.
StandaloneGlb plain_file(const StandaloneGlb& file, const std::string& entry, const RunContext& context);

}  // namespace texmesh
