#pragma once
#include <cstdint>

#include "delivery/cpp/package/package_reader.h"
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

}  // namespace texmesh
