#pragma once
#include <optional>

#include "format/base/bytes.h"
#include "format/model/model.h"
#include "stages/data/pixels.h"

namespace texmesh {

struct ImageLimits {
  std::uint32_t max_side_px = 65500;
  std::uint64_t max_pixels = 20000ull * 20000ull;
};

/// What the header of an image says.
struct ImageHeader {
  std::uint32_t width_px = 0, height_px = 0;
  std::uint8_t channels = 0, bits_per_channel = 0;
};

/// The allow-listed format that the first bytes show; nothing for any other content.
std::optional<ImageFormat> sniff_image_format(ByteSpan bytes);

/// "JPEG", "PNG", "TIFF", "WebP", "EXR".
const char* image_format_name(ImageFormat format);

/// "jpg", "png", "tif", "webp", "exr".
const char* image_extension(ImageFormat format);

/// InputError when the image is empty or larger than the limits. `name` is for the message.
void check_image_size(const std::string& name, std::uint64_t width_px, std::uint64_t height_px,
                      const ImageLimits& limits);

/// What samples become: kAsIs for data (normals, roughness); kSrgb for colours: float files (EXR, float TIFF)
/// hold linear light where every other image of a material is sRGB encoded, and images with
/// Image::honour_profile go by their ICC profile or gamma (stages/image/image_metadata.h).
enum class FloatEncoding : std::uint8_t { kAsIs, kSrgb };

/// Reads the header with the reader of exactly that format (never by OpenImageIO's own content sniffing) and
/// checks size and channels against the limits before any pixel is read. `name` is for messages. Throws
/// InputError. Channels beyond the colour (depth, object ids in EXR and TIFF) are left out, but a TIFF's
/// second or fourth that says nothing of itself is its alpha; CMYK becomes RGB, palettes RGB or RGBA.
Image probe_image(std::string name, Bytes bytes, const ImageLimits& limits);

/// Whoever changes the pixels raises kFillVersion (stages/fill/fill.h).
/// Decodes to 8 bits per channel (16-bit and float images are scaled and rounded; float is clamped to 0..1,
/// NaN is 0), with the channel count of the file (1..4), top row first, no colour conversion beyond
/// `encoding`, alpha not multiplied in. Rows and columns are those of the file whatever its EXIF orientation
/// says: texture coordinates count from the first stored pixel. Single-threaded; the same bytes for every
/// run. Throws InputError when the file is truncated (with the row), lies about its size, or has a colour
/// profile to be honoured that cannot be. Image::accept_damage: what decode_jpeg() makes of a damaged JPEG;
/// `damage`, if there is one, becomes what is wrong with it, and empty for a sound image.
Pixels decode_image(const Image& image, FloatEncoding encoding = FloatEncoding::kAsIs,
                    std::string* damage = nullptr);

/// A warning's words for what decode_image() says of a damaged image.
std::string damage_words(const std::string& damage);

/// Whether decode_image() gives other colours than the file's own numbers: CMYK, floats, or a profile that is
/// honoured. Throws as decode_image.
bool changes_colours(const Image& image, FloatEncoding encoding);

/// Decodes without loss of range, for measured data such as range scans. Errors as decode_image.
FloatPixels decode_float(const Image& image);

}  // namespace texmesh
