#pragma once
// What textures of OBJ, PLY and older glTF are beside the kinds of Image. Packages keep sources of a closed
// list of kinds (SPEC.md X03, W06), so these files become others with the same texels when they are imported.
#include <cstddef>

#include "stages/image/decode_image.h"

namespace texmesh {

enum class OtherPicture : std::uint8_t { kBmp, kTga, kGif, kDds, kJpeg2000, kHdr };

/// "BMP", "TGA", "GIF", "DDS", "JPEG 2000", "Radiance HDR".
constexpr const char* other_picture_name(OtherPicture kind) {
  constexpr const char* kNames[] = {"BMP", "TGA", "GIF", "DDS", "JPEG 2000", "Radiance HDR"};
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

/// The texels by OpenImageIO, top row first: those of an HDR are light, as in an EXR, all others values as
/// they stand. Alpha that is 0 everywhere, or opaque, is left out: BMP and TGA have a fourth byte that says
/// nothing. Of a DDS the largest level, and normals of two channels (BC5) with their third. Size and number
/// of tiles are checked against the limits and against the bytes before a reader takes memory for them.
/// InputError for damaged files, cubes, volumes, and an HDR that is turned; and where the module cannot be
/// loaded.
ConvertedPicture convert_other_picture(const std::string& name, OtherPicture kind, ByteSpan bytes,
                                       const ImageLimits& limits);

}  // namespace texmesh
