#pragma once
#include <optional>
#include <span>

#include "format/model/model.h"
#include "stages/data/pixels.h"

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

// ICC profiles of textures, to sRGB. This is own code for the two simple kinds that cameras, scanners and
// editors embed: three primaries with curves, and a grey curve. A colour management library computes its
// tables with libm, whose last bits differ between processors. Profiles made of lookup tables (printers,
// CMYK) are refused, and the message says what to do; they are never guessed.

/// How stored values become light: linear RGB with the primaries of sRGB, 0..1 within its gamut.
struct ColourProfile {
  bool grey = false;
  std::array<std::vector<double>, 3> curve;  // light per code, 256 or 65,536 of them; grey: the first only
  std::array<std::array<double, 3>, 3> to_srgb{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
};

inline constexpr std::size_t kByteCodes = 256, kWordCodes = 65536;

/// Reads a profile for an image of `channels` (alpha included), its curves at `codes` points. Throws
/// InputError{name, "colour profile", ...} when it is of another kind, damaged, or not for such an image.
ColourProfile read_icc_profile(const std::string& name, std::span<const std::uint8_t> profile,
                               std::uint32_t channels, std::size_t codes = kByteCodes);

/// PNG's gAMA chunk: stored value = light ^ gamma.
ColourProfile gamma_profile(double gamma, std::uint32_t channels, std::size_t codes = kByteCodes);

/// No 8-bit colour changes by more than 2 of 255: nothing to convert.
bool is_srgb(const ColourProfile& profile);

/// Stored values to sRGB codes, in place; alpha stays. Colours outside sRGB's gamut are clipped. For a
/// profile of 256 codes.
void convert_to_srgb(const ColourProfile& profile, Pixels& pixels);

/// The same from the samples that `pixels` were rounded from, so that dark linear values keep their steps:
/// floats are clamped to 0..1, NaN is 0. For a profile of 65,536 codes.
void convert_to_srgb(const ColourProfile& profile, const std::vector<std::uint16_t>& samples, Pixels& pixels);
void convert_to_srgb(const ColourProfile& profile, const std::vector<float>& samples, Pixels& pixels);

}  // namespace texmesh
