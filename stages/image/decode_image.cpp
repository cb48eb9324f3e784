#include "format/base/portable_math.h"
#include "stages/image/decode_jpeg.h"
#include "stages/image/decode_tiff_exr.h"
#include "stages/image/image_metadata.h"
#include "stages/image/png_writer.h"
#include "stages/image/webp.h"

namespace texmesh {
namespace {

std::string first_bytes(ByteSpan bytes) {
  if (bytes.empty()) return "no bytes";
  static constexpr char kHex[] = "0123456789abcdef";
  std::string s = "bytes";
  for (std::size_t i = 0; i < std::min<std::size_t>(bytes.size(), 8); ++i)
    s += std::string(" ") + kHex[bytes[i] >> 4] + kHex[bytes[i] & 15];
  return s;
}

std::uint8_t to_byte(double x) {
  if (!(x > 0)) return 0;  // NaN too
  return x >= 1 ? 255 : static_cast<std::uint8_t>(std::floor(x * 255 + 0.5));
}

double srgb_from_linear(double x) {
  if (!(x > 0)) return 12.92 * x;  // NaN too
  return x >= 1 ? 1 : srgb_of_light(x);
}

std::vector<std::uint8_t> bytes_from_words(const std::vector<std::uint16_t>& words) {
  std::vector<std::uint8_t> out(words.size());
  for (std::size_t i = 0; i < words.size(); ++i)
    out[i] = static_cast<std::uint8_t>((words[i] * 255u + 32767u) / 65535u);
  return out;
}

std::vector<std::uint8_t> bytes_from_floats(const std::vector<float>& values, std::uint32_t channels,
                                            FloatEncoding encoding) {
  const std::uint32_t alpha = channels == 2 || channels == 4 ? channels - 1 : channels;
  std::vector<std::uint8_t> out(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool colour = i % channels != alpha;
    out[i] = to_byte(encoding == FloatEncoding::kSrgb && colour ? srgb_from_linear(values[i]) : values[i]);
  }
  return out;
}

Pixels decode_jpeg_pixels(const Image& image, std::string& damage) {
  Pixels pixels{image.width_px, image.height_px, image.channels, {}};
  const std::size_t row_bytes = static_cast<std::size_t>(image.width_px) * image.channels;
  // Reserved, not filled: memory is touched row by row, so that a header that lies costs nothing.
  pixels.data.reserve(row_bytes * image.height_px);
  decode_jpeg(
      image.name, image.bytes,
      [&](const std::uint8_t* row) { pixels.data.insert(pixels.data.end(), row, row + row_bytes); },
      image.accept_damage ? &damage : nullptr);
  return pixels;
}

ImageHeader header_of(const JpegHeader& h) {
  return {h.width_px, h.height_px, static_cast<std::uint8_t>(h.channels), 8};
}

ImageHeader header_of(const PngHeader& h) {
  return {h.width_px, h.height_px, static_cast<std::uint8_t>(h.channels), static_cast<std::uint8_t>(h.bits)};
}

void check_unchanged(const Image& image, const char* place, const ImageHeader& header) {
  if (header.width_px != image.width_px || header.height_px != image.height_px ||
      header.channels != image.channels || header.bits_per_channel != image.bits_per_channel)
    throw InputError(image.name, place, "the size that import had found", "another one");
}

// Every sample of a PNG, 16-bit ones as words.
template <class T>
std::vector<T> png_pixels(const Image& image) {
  check_unchanged(image, "PNG header", header_of(read_png_header(image.name, image.bytes)));
  const std::size_t row = static_cast<std::size_t>(image.width_px) * image.channels;
  std::vector<T> samples;
  samples.reserve(row * image.height_px);  // filled row by row, so that a header that lies costs nothing
  decode_png(image.name, image.bytes, [&](const std::uint8_t* from) {
    const std::size_t before = samples.size();
    samples.resize(before + row);
    std::memcpy(samples.data() + before, from, row * sizeof(T));
  });
  return samples;
}

void store_words(const std::vector<std::uint16_t>& words, const ColourProfile* profile, Pixels& pixels) {
  pixels.data = bytes_from_words(words);
  if (profile) convert_to_srgb(*profile, words, pixels);
}

void store_floats(const std::vector<float>& values, FloatEncoding encoding, const ColourProfile* profile,
                  Pixels& pixels) {
  pixels.data = bytes_from_floats(values, pixels.channels, profile ? FloatEncoding::kAsIs : encoding);
  if (profile) convert_to_srgb(*profile, values, pixels);
}

/// Samples of 16 bits and floats go by `profile`, if any, before they are rounded.
Pixels decode_stored(const Image& image, FloatEncoding encoding, const ColourProfile* profile,
                     std::string& damage) {
  if (image.format == ImageFormat::kJpeg && image.bits_per_channel == 8) {
    check_unchanged(image, "JPEG header", header_of(read_jpeg_header(image.name, image.bytes)));
    return decode_jpeg_pixels(image, damage);
  }
  Pixels pixels{image.width_px, image.height_px, image.channels, {}};
  if (image.format == ImageFormat::kJpeg) {
    store_words(decode_wide_jpeg(image), profile, pixels);
    return pixels;
  }
  if (image.format == ImageFormat::kWebp) {
    pixels.data = decode_webp_samples(image);
    return pixels;
  }
  if (image.format == ImageFormat::kPng) {
    if (image.bits_per_channel == 16)
      store_words(png_pixels<std::uint16_t>(image), profile, pixels);
    else
      pixels.data = png_pixels<std::uint8_t>(image);
    return pixels;
  }
  StoredSamples samples = decode_tiff_exr(image);
  if (auto* bytes = std::get_if<std::vector<std::uint8_t>>(&samples))
    pixels.data = std::move(*bytes);
  else if (const auto* words = std::get_if<std::vector<std::uint16_t>>(&samples))
    store_words(*words, profile, pixels);
  else
    store_floats(std::get<std::vector<float>>(samples), encoding, profile, pixels);
  return pixels;
}

ImageHeader read_header(const std::string& name, ImageFormat format, ByteSpan bytes,
                        const ImageLimits& limits) {
  if (format == ImageFormat::kJpeg) {
    if (const auto wide = read_wide_jpeg_header(name, bytes))
      return {wide->width_px, wide->height_px, static_cast<std::uint8_t>(wide->channels), 16};
    return header_of(read_jpeg_header(name, bytes));
  }
  if (format == ImageFormat::kPng) return header_of(read_png_header(name, bytes));
  if (format == ImageFormat::kWebp) return read_webp_header(name, bytes);
  const std::string colours = read_image_metadata(format, bytes).foreign_colours;
  if (!colours.empty())
    throw InputError(name, "image header", "grey, RGB, palette, YCbCr or CMYK (convert it to sRGB)", colours);
  return read_tiff_exr_header(name, format, bytes, limits);
}

/// Nothing when the image is sRGB anyway. Floats that say so are sRGB encoded, the others linear.
std::optional<ColourProfile> honoured_profile(const Image& image) {
  const ImageMetadata metadata = read_image_metadata(image.format, image.bytes);
  std::optional<ColourProfile> profile;
  const std::size_t codes = image.bits_per_channel > 8 ? kWordCodes : kByteCodes;
  if (metadata.damaged_profile)
    throw InputError(image.name, "colour profile", "a whole ICC profile of at most 16 MB", "a damaged one");
  if (!metadata.icc_profile.empty()) {
    if (metadata.cmyk)
      throw InputError(image.name, "colour profile", "an RGB or grey image (convert it to sRGB)",
                       "CMYK with a profile of its own");
    profile = read_icc_profile(image.name, metadata.icc_profile, image.channels, codes);
  } else if (metadata.gamma > 0) {
    profile = gamma_profile(metadata.gamma, image.channels, codes);
  }
  if (profile && image.bits_per_channel <= 16 && is_srgb(*profile)) profile.reset();
  return profile;
}

}  // namespace

Image probe_image(std::string name, Bytes bytes, const ImageLimits& limits) {
  const std::optional<ImageFormat> format = sniff_image_format(bytes);
  if (!format)
    throw InputError(
        name, "first bytes",
        "JPEG, PNG, TIFF, WebP or EXR (of models AVIF, KTX2, BMP, TGA, GIF, DDS, JPEG 2000 and HDR, too)",
        first_bytes(bytes));
  const ImageHeader header = read_header(name, *format, bytes, limits);
  check_image_size(name, header.width_px, header.height_px, limits);
  Image image;
  image.format = *format;
  image.width_px = header.width_px;
  image.height_px = header.height_px;
  image.channels = header.channels;
  image.bits_per_channel = header.bits_per_channel;
  image.name = std::move(name);
  image.bytes = std::move(bytes);
  return image;
}

Pixels decode_image(const Image& image, FloatEncoding encoding, std::string* damage) {
  // Before the pixels, since a profile may be refused.
  std::optional<ColourProfile> profile;
  if (encoding == FloatEncoding::kSrgb && image.honour_profile) profile = honoured_profile(image);
  std::string found;
  Pixels pixels = decode_stored(image, encoding, profile ? &*profile : nullptr, found);
  if (profile && image.bits_per_channel <= 8) convert_to_srgb(*profile, pixels);
  if (damage) *damage = std::move(found);
  return pixels;
}

std::string damage_words(const std::string& damage) {
  return "it is damaged (" + damage + "); what cannot be read of it is grey or wrong";
}

bool changes_colours(const Image& image, FloatEncoding encoding) {
  if (image.bits_per_channel > 16 || read_image_metadata(image.format, image.bytes).cmyk) return true;
  return encoding == FloatEncoding::kSrgb && image.honour_profile && honoured_profile(image).has_value();
}

FloatPixels decode_float(const Image& image) {
  FloatPixels pixels{image.width_px, image.height_px, image.channels, {}};
  auto widen = [&pixels](const auto& samples) { pixels.data.assign(samples.begin(), samples.end()); };
  if (image.format == ImageFormat::kPng && image.bits_per_channel == 16) {
    widen(png_pixels<std::uint16_t>(image));
    return pixels;
  }
  if (image.format == ImageFormat::kJpeg && image.bits_per_channel == 16) {
    widen(decode_wide_jpeg(image));
    return pixels;
  }
  if (image.format != ImageFormat::kTiff && image.format != ImageFormat::kExr) {
    widen(decode_image(image).data);
    return pixels;
  }
  std::visit(widen, decode_tiff_exr(image));
  return pixels;
}

}  // namespace texmesh
