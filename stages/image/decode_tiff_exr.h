#pragma once
// Inside stages: what the module texmesh_readers.so reads, which is loaded when it is first needed: TIFF and
// EXR by OpenImageIO, and JPEGs of 9 to 16 bits a sample, which libjpeg-turbo does not read, by DCMTK.
#include <functional>
#include <variant>

#include "stages/image/decode_image.h"

namespace texmesh {

/// Interleaved samples as the file stores them: 8 or 16 bits, or floats, which wider integers become, too.
using StoredSamples = std::variant<std::vector<std::uint8_t>, std::vector<std::uint16_t>, std::vector<float>>;

/// Channels beyond colour and alpha do not count. `name` is for messages. InputError for a header that cannot
/// be read, for images outside the limits, and for volumes and deep data.
ImageHeader read_tiff_exr_header(const std::string& name, ImageFormat format, ByteSpan bytes,
                                 const ImageLimits& limits);

/// InputError when the file is damaged or truncated (with the rows), when it cannot hold what its header
/// claims, and when its header is not the one that `image` was made from. Both functions: InputError, with
/// the name of Debian's package, where the module cannot be loaded.
StoredSamples decode_tiff_exr(const Image& image);

struct ExrAttribute {
  std::string_view name, type;
  std::uint32_t bytes = 0;  // as it claims
  ByteSpan value;           // as many of them as the file has
};

/// Calls f(part, attribute) for the attributes in front of an EXR's pixels, in order, up to one that has no
/// name, type or length (OpenEXR, "File Layout").
void for_each_exr_attribute(ByteSpan exr,
                            const std::function<void(std::size_t part, const ExrAttribute&)>& f);

struct WideJpegHeader {
  std::uint32_t width_px = 0, height_px = 0;
  std::uint32_t channels = 0;  // 1 or 3, after decoding
  std::uint32_t bits = 0;      // of a sample: 9 to 16
};

/// Nothing for JPEGs of 8 bits and for what is no JPEG. `name` is for messages. InputError when it has other
/// numbers of components than 1 and 3.
std::optional<WideJpegHeader> read_wide_jpeg_header(const std::string& name, ByteSpan bytes);

/// Interleaved samples, 0..65535 whatever the file's bits, top row first; YCbCr becomes RGB. Memory for the
/// whole image is taken at once, if its bytes can hold it. InputError when the file is damaged, ends early,
/// or its header is not the one that `image` was made from.
std::vector<std::uint16_t> decode_wide_jpeg(const Image& image);

}  // namespace texmesh
