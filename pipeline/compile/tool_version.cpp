// Apart from the libraries' versions, so that a program that tells its own version needs none of them.
#include "pipeline/compile/library_versions.h"

namespace texmesh {

std::string tool_version() { return TEXMESH_VERSION; }

}  // namespace texmesh
