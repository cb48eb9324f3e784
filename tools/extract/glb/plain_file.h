#pragma once
#include <string>

#include "tools/extract/glb/standalone_glb.h"

namespace texmesh {

/// The same model for programs that know glTF 2.0 and no extension of it that compresses: floats instead of
/// KHR_draco_mesh_compression, EXT_meshopt_compression and KHR_mesh_quantization, PNG instead of WebP,
/// no KHR_texture_transform where it is one scale. Parts
/// and materials stay; tangents go, and the feature ids of merged parts. Of a file without levels of detail
/// and before move_to(). Same bytes for any thread count.
StandaloneGlb plain_file(const StandaloneGlb& file, const std::string& entry, const RunContext& context);

}  // namespace texmesh
