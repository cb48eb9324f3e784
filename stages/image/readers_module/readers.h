#pragma once
// What the program and its module texmesh_readers.so say to each other.

#include "stages/image/decode_tiff_exr.h"
#include "stages/image/readers_module/other_pictures.h"

namespace texmesh {

struct PictureSamples {
  std::uint32_t channels = 0;  // 1 to 4; the last of two and of four is alpha
  bool more_pictures = false, profile = false;
  StoredSamples samples;
};

/// They throw InputError.
struct ModuleReaders {
  // The functions of stages/image/decode_tiff_exr.h, by OpenImageIO.
  ImageHeader (*read_tiff_exr_header)(const std::string& name, ImageFormat format, ByteSpan bytes,
                                      const ImageLimits& limits);
  StoredSamples (*decode_tiff_exr)(const Image& image);
  // The first picture of a file of that kind and size, by OpenImageIO, top row first.
  PictureSamples (*read_picture)(const std::string& name, OtherPicture kind, ByteSpan bytes,
                                 const PictureSize& size);
  // Samples of a JPEG with this header as the file has them, by DCMTK.
  std::vector<std::uint16_t> (*decode_wide_jpeg)(const std::string& name, ByteSpan bytes,
                                                 const WideJpegHeader& header);
};

/// ModuleReaders::decode_wide_jpeg, inside the module.
std::vector<std::uint16_t> decode_wide_jpeg_file(const std::string& name, ByteSpan bytes,
                                                 const WideJpegHeader& header);

/// The module's only symbol: its name holds a version, which is raised with every change of what the readers
/// take or give, so that the module of another build is never called.
inline constexpr const char* kReadersSymbol = "texmesh_readers_3";

/// Loads the module when it is first called. Throws InputError{name, ...} where it cannot be loaded; `what`
/// and `package`, of Debian, are for its message.
const ModuleReaders& module_readers(const std::string& name, const std::string& what,
                                    const std::string& package);

}  // namespace texmesh

extern "C" const texmesh::ModuleReaders* texmesh_readers_3();
