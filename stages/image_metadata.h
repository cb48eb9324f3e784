#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "format/model.h"

namespace texmesh {

/// What an image file says about its colours and its orientation beside the pixels.
struct ImageMetadata {
  std::vector<std::uint8_t> icc_profile;  // empty = none
  double gamma = 0;  // PNG gAMA without a profile: file value = light ^ gamma; 0 = not said, or sRGB
  bool other_primaries = false;  // PNG cHRM, without a profile, of other colours than sRGB's
  bool cmyk = false;
  std::string foreign_colours;  // TIFF: what its values are, when not grey, RGB, a palette, YCbCr or inks
  int orientation = 1;          // as EXIF counts: 1 = as stored, 2..8 = to be turned or mirrored for display
};

/// Walks the file's segments (JPEG), chunks (PNG, WebP) or tags (TIFF, first page). Damaged metadata count as
/// absent: nothing here keeps an image from being decoded. Profiles over 16 MB are left out. EXR has none.
ImageMetadata read_image_metadata(ImageFormat format, std::span<const std::uint8_t> bytes);

}  // namespace texmesh
