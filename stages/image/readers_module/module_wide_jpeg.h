#pragma once
// Inside the module texmesh_readers.so.
#include <cstdint>
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "stages/image/readers_module/wide_jpeg.h"

namespace texmesh {

/// ModuleReaders::decode_wide_jpeg.
std::vector<std::uint16_t> decode_wide_jpeg_file(const std::string& name, ByteSpan bytes,
                                                 const WideJpegHeader& header);

}  // namespace texmesh
