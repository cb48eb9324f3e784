#pragma once
// What the program and its module texmesh_readers.so say to each other.
#include <string>

#include "format/base/bytes.h"
#include "stages/image/decode_tiff_exr.h"

namespace texmesh {

/// The functions of stages/image/decode_tiff_exr.h, by OpenImageIO. They throw InputError.
struct SeldomReaders {
  ImageHeader (*read_header)(const std::string& name, ImageFormat format, ByteSpan bytes,
                             const ImageLimits& limits);
  StoredSamples (*decode)(const Image& image);
};

/// The module's only symbol: its name holds a version, which is raised with every change of what the reader
/// takes or gives, so that the module of another build is never called.
inline constexpr const char* kSeldomReadersSymbol = "texmesh_seldom_readers_1";

}  // namespace texmesh

extern "C" const texmesh::SeldomReaders* texmesh_seldom_readers_1();
