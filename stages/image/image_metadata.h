#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "format/model/model.h"

namespace texmesh {

/// What an image file says about its colours and its orientation beside the pixels.
struct ImageMetadata {
  std::vector<std::uint8_t> icc_profile;  // empty = none
  bool damaged_profile = false;           // there is one, but not whole, or larger than 16 MB
  double gamma = 0;  // PNG gAMA without a profile: file value = light ^ gamma; 0 = not said, or sRGB
  // PNG cHRM without a profile, or EXR's chromaticities, of other colours than sRGB's:
  bool other_primaries = false;
  bool cmyk = false;
  std::string foreign_colours;  // TIFF: what its values are, when not grey, RGB, a palette, YCbCr or inks
  bool more_pictures = false;   // TIFF with pages, animated PNG, EXR with parts: the first is the image
  int orientation = 1;          // as EXIF counts: 1 = as stored, 2..8 = to be turned or mirrored for display
};

/// Walks the file's segments (JPEG), chunks (PNG, WebP), tags (TIFF, first page) or attributes (EXR, first
/// part). Damaged metadata count as absent, but for profiles, without which colours would be others.
ImageMetadata read_image_metadata(ImageFormat format, std::span<const std::uint8_t> bytes);

}  // namespace texmesh
