#pragma once
#include <cstdint>
#include <string>

#include "format/model/model.h"
#include "stages/base/run_context.h"

namespace texmesh {

class StandaloneGlb;

/// The mesh and materials of a file. Its images become single texels, all different (import makes equal ones
/// one), named by image_name() of their source image.
Model read_model(StandaloneGlb file, const std::string& entry, const RunContext& context);

/// As import names "texture/<image>": without the folder.
std::string image_name(std::uint32_t image);

}  // namespace texmesh
