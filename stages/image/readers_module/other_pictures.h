#pragma once
// What textures of OBJ, PLY and older glTF are beside the kinds of Image. Packages keep sources of a closed
// list of kinds (SPEC.md X03, W06), so these files become others with the same texels when they are imported.
// Behind that stands what the program and its module texmesh_readers.so say to each other.

#include "stages/image/decode_tiff_exr.h"

namespace texmesh {

enum class OtherPicture : std::uint8_t { kBmp, kTga, kGif, kDds, kJpeg2000, kHdr, kAvif };

/// "BMP", "TGA", "GIF", "DDS", "JPEG 2000", "Radiance HDR", "AVIF".
constexpr const char* other_picture_name(OtherPicture kind) {
  constexpr const char* kNames[] = {"BMP", "TGA", "GIF", "DDS", "JPEG 2000", "Radiance HDR", "AVIF"};
  return kNames[static_cast<std::size_t>(kind)];
}

struct PictureSize {
  std::uint32_t width_px = 0, height_px = 0;
};

/// What the first bytes show; a TGA, which has none of its own, by the extension of its name and a header
/// that makes sense. Nothing for any other content.
std::optional<OtherPicture> sniff_other_picture(const std::string& name, ByteSpan bytes);

struct ConvertedPicture {
  Bytes bytes;                 // of a PNG, or of a TIFF where samples have 16 bits or are floats
  bool more_pictures = false;  // the first is read
  bool profile = false;        // of colours, which is left out
};

/// The texels by OpenImageIO, of an AVIF by libavif, top row first: those of an HDR are light, as in an EXR,
/// all others values as they stand. Alpha that is 0 everywhere, or opaque, is left out: BMP and TGA have a
/// fourth byte that says nothing. Of a DDS the largest level, and normals of two channels (BC5) with their
/// third. Size and number of tiles are checked against the limits and against the bytes before a reader takes
/// memory for them. InputError for damaged files, cubes, volumes, and an HDR that is turned; and where the
/// module cannot be loaded.
ConvertedPicture convert_other_picture(const std::string& name, OtherPicture kind, ByteSpan bytes,
                                       const ImageLimits& limits);

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
