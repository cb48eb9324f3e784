#pragma once
// What the program and its module texmesh_readers.so say to each other.
#include <cstdint>
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "stages/image/decode_tiff_exr.h"
#include "stages/image/seldom/wide_jpeg.h"

namespace texmesh {

/// They throw InputError.
struct SeldomReaders {
  // The functions of stages/image/decode_tiff_exr.h, by OpenImageIO.
  ImageHeader (*read_tiff_exr_header)(const std::string& name, ImageFormat format, ByteSpan bytes,
                                      const ImageLimits& limits);
  StoredSamples (*decode_tiff_exr)(const Image& image);
  // Samples of a JPEG with this header as the file has them, by DCMTK.
  std::vector<std::uint16_t> (*decode_wide_jpeg)(const std::string& name, ByteSpan bytes,
                                                 const WideJpegHeader& header);
};

/// The module's only symbol: its name holds a version, which is raised with every change of what the readers
/// take or give, so that the module of another build is never called.
inline constexpr const char* kSeldomReadersSymbol = "texmesh_seldom_readers_2";

/// Loads the module when it is first called. Throws InputError{name, ...} where it cannot be loaded; `what`
/// and `package`, of Debian, are for its message.
const SeldomReaders& seldom_readers(const std::string& name, const std::string& what,
                                    const std::string& package);

}  // namespace texmesh

extern "C" const texmesh::SeldomReaders* texmesh_seldom_readers_2();
