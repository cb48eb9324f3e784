#pragma once
#include <string>

#include "format/base/bytes.h"

namespace texmesh {

/// The same GLB with this asset.copyright; as it is for "". Order of names and every other value stay.
/// FormatError when it is no GLB.
Bytes with_copyright(const Bytes& glb, const std::string& line);

}  // namespace texmesh
