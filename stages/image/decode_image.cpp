#include "stages/image/decode_image.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <mutex>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <webp/decode.h>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "format/base/srgb.h"
#include "stages/image/colour_profile.h"
#include "stages/image/decode_jpeg.h"
#include "stages/image/decode_png.h"
#include "stages/image/image_metadata.h"

namespace texmesh {
namespace {

const char* reader_name(ImageFormat format) {
  switch (format) {
    case ImageFormat::kJpeg:
      return "jpeg";
    case ImageFormat::kPng:
      return "png";
    case ImageFormat::kTiff:
      return "tiff";
    case ImageFormat::kWebp:
      return "webp";
    case ImageFormat::kExr:
      return "openexr";
  }
  return "";
}

std::string first_bytes(ByteSpan bytes) {
  if (bytes.empty()) return "no bytes";
  static constexpr char kHex[] = "0123456789abcdef";
  std::string s = "bytes";
  for (std::size_t i = 0; i < std::min<std::size_t>(bytes.size(), 8); ++i)
    s += std::string(" ") + kHex[bytes[i] >> 4] + kHex[bytes[i] & 15];
  return s;
}

void check_size(const std::string& name, std::uint64_t width, std::uint64_t height,
                const ImageLimits& limits) {
  const std::string found = std::to_string(width) + " x " + std::to_string(height);
  if (width == 0 || height == 0) throw InputError(name, "image header", "at least 1 x 1 px", found);
  if (width > limits.max_side_px || height > limits.max_side_px)
    throw InputError(name, "image header", "sides up to " + std::to_string(limits.max_side_px) + " px",
                     found);
  if (width * height > limits.max_pixels)
    throw InputError(name, "image header", "up to " + std::to_string(limits.max_pixels) + " pixels", found);
}

// WebP by libwebp itself: OpenImageIO 2.4 multiplies alpha into the colours whatever it is asked.
WebPBitstreamFeatures read_webp_header(const std::string& name, ByteSpan bytes) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(bytes.data(), bytes.size(), &features) != VP8_STATUS_OK)
    throw InputError(name, "WebP header", "a readable one", "a damaged or truncated one");
  if (features.has_animation) throw InputError(name, "WebP header", "a still image", "an animation");
  return features;
}

/// Row by row into memory that is touched as far as there are rows.
void decode_webp_into(const Image& image, std::uint8_t* pixels, std::size_t size) {
  const std::unique_ptr<WebPIDecoder, void (*)(WebPIDecoder*)> decoder(
      WebPINewRGB(image.channels == 4 ? MODE_RGBA : MODE_RGB, pixels, size,
                  static_cast<int>(image.width_px * image.channels)),
      WebPIDelete);
  if (!decoder) throw InputError(image.name, "pixels", "memory for a WebP decoder", "none");
  const VP8StatusCode status = WebPIUpdate(decoder.get(), image.bytes.data(), image.bytes.size());
  if (status == VP8_STATUS_OK) return;
  int row = 0;
  if (!WebPIDecGetRGB(decoder.get(), &row, nullptr, nullptr, nullptr)) row = 0;
  throw InputError(image.name, "row " + std::to_string(row) + " of " + std::to_string(image.height_px),
                   "a whole WebP", status == VP8_STATUS_SUSPENDED ? "a truncated one" : "a damaged one");
}

constexpr std::size_t kWebpShrinks = 1000;  // more than this pictures with any noise do not

std::vector<std::uint8_t> decode_webp(const Image& image) {
  const WebPBitstreamFeatures features = read_webp_header(image.name, image.bytes);
  const bool alpha = features.has_alpha != 0;
  if (static_cast<std::uint32_t>(features.width) != image.width_px ||
      static_cast<std::uint32_t>(features.height) != image.height_px || image.channels != (alpha ? 4 : 3))
    throw InputError(image.name, "WebP header", "the size that import had found", "another one");
  const std::size_t size = static_cast<std::size_t>(image.width_px) * image.height_px * image.channels;
  if (size / kWebpShrinks > image.bytes.size()) {  // a lie or one colour: shown to be whole before it costs
    const auto untouched = std::make_unique_for_overwrite<std::uint8_t[]>(size);
    decode_webp_into(image, untouched.get(), size);
    return {untouched.get(), untouched.get() + size};
  }
  std::vector<std::uint8_t> out(size);
  decode_webp_into(image, out.data(), size);
  return out;
}

// An image file opened by the reader of its format, in memory; keep the bytes alive.
struct OpenImage {
  std::unique_ptr<OIIO::Filesystem::IOMemReader> memory;
  std::unique_ptr<OIIO::ImageInput> input;
  OIIO::ImageSpec spec;
};

std::string reader_error(OIIO::ImageInput& input) {
  std::string s = input.geterror();
  // OpenImageIO repeats and ends messages with line feeds.
  while (!s.empty() && (s.back() == '\n' || s.back() == ' ')) s.pop_back();
  std::replace(s.begin(), s.end(), '\n', ' ');
  return s.empty() ? "an error without a message" : s;
}

OpenImage open_image(const std::string& name, ImageFormat format, ByteSpan bytes) {
  static std::once_flag once;
  std::call_once(once, [] {
    // One model, one child process, --jobs of them: the pools of OpenImageIO and OpenEXR would only add
    // threads.
    OIIO::attribute("threads", 1);
    OIIO::attribute("exr_threads", -1);
  });
  OpenImage open;
  open.memory = std::make_unique<OIIO::Filesystem::IOMemReader>(bytes.data(), bytes.size());
  open.input = OIIO::ImageInput::create(reader_name(format));
  if (!open.input)
    throw InputError(name, "", std::string("OpenImageIO's reader for ") + image_format_name(format), "none");
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  open.input->set_ioproxy(open.memory.get());
  if (!open.input->open("memory", open.spec, config))
    throw InputError(name, "image header", std::string("a readable ") + image_format_name(format),
                     reader_error(*open.input));
  return open;
}

/// Of an EXR, whose channels have names: colours and their alpha come first, then Z, ids and others.
std::uint32_t exr_channels(const OIIO::ImageSpec& spec) {
  if (spec.alpha_channel == 1 || spec.alpha_channel == 3)
    return static_cast<std::uint32_t>(spec.alpha_channel) + 1;
  const bool grey = spec.nchannels < 3 || (spec.channelnames[0] == "Y" && spec.channelnames[1] != "RY" &&
                                           spec.channelnames[1] != "BY");
  return grey ? 1 : 3;
}

std::uint32_t colour_channels(const OIIO::ImageSpec& spec, ImageFormat format) {
  if (format == ImageFormat::kExr && spec.nchannels > 0) return exr_channels(spec);
  const auto n = static_cast<std::uint32_t>(std::max(spec.nchannels, 0));
  if (n <= 4) return n;
  return spec.alpha_channel == 3 ? 4 : 3;
}

std::uint8_t bits_of(const OIIO::ImageSpec& spec) {
  switch (spec.format.basetype) {
    case OIIO::TypeDesc::UINT8:
      return 8;
    case OIIO::TypeDesc::UINT16:
      return 16;
    default:
      return 32;
  }
}

void check_spec(const std::string& name, const OIIO::ImageSpec& spec, const ImageLimits& limits) {
  check_size(name, static_cast<std::uint64_t>(std::max(spec.width, 0)),
             static_cast<std::uint64_t>(std::max(spec.height, 0)), limits);
  if (spec.depth > 1) throw InputError(name, "image header", "a flat image", "a volume");
  if (spec.deep) throw InputError(name, "image header", "a flat image", "deep data");
  if (spec.nchannels < 1 || spec.nchannels > 64)
    throw InputError(name, "image header", "1 to 64 channels", std::to_string(spec.nchannels));
}

// No packer of TIFF or EXR shrinks a picture with any noise further: what claims more lies about its size,
// and is told so before memory is taken. (Deflate ends at 1032; the rest is for the newer ones.)
void check_plausible(const Image& image) {
  constexpr std::uint64_t kMostShrunk = 20000;
  if (std::uint64_t{image.width_px} * image.height_px * image.channels / kMostShrunk <= image.bytes.size())
    return;
  throw InputError(image.name, "image header",
                   "a size that its " + std::to_string(image.bytes.size()) + " bytes can hold",
                   std::to_string(image.width_px) + " x " + std::to_string(image.height_px));
}

OpenImage open_checked(const Image& image) {
  OpenImage open = open_image(image.name, image.format, image.bytes);
  if (static_cast<std::uint32_t>(open.spec.width) != image.width_px ||
      static_cast<std::uint32_t>(open.spec.height) != image.height_px ||
      colour_channels(open.spec, image.format) != image.channels)
    throw InputError(image.name, "image header", "the size that import had found", "another one");
  check_plausible(image);
  return open;
}

[[noreturn]] void fail_pixels(const Image& image, OpenImage& open, const std::string& place) {
  throw InputError(image.name, place, std::string("a whole ") + image_format_name(image.format),
                   reader_error(*open.input));
}

// The file's own samples as T. Errors of the reader, truncation included, are InputError and name the rows.
template <class T>
std::vector<T> read_samples(const Image& image, OpenImage& open, OIIO::TypeDesc type) {
  const int channels = static_cast<int>(image.channels), height = static_cast<int>(image.height_px);
  const std::size_t row = static_cast<std::size_t>(image.width_px) * image.channels;
  std::vector<T> samples;
  if (open.spec.tile_width > 0) {
    samples.resize(row * image.height_px);
    if (!open.input->read_image(0, 0, 0, channels, type, samples.data()) || open.input->has_error())
      fail_pixels(image, open, "pixels");
    return samples;
  }
  constexpr int kRows = 64;                // at once
  samples.reserve(row * image.height_px);  // not touched before it is read
  const int first = open.spec.y;           // the data window of an EXR may begin anywhere
  for (int y = 0; y < height; y += kRows) {
    const int end = std::min(height, y + kRows);
    samples.resize(row * static_cast<std::size_t>(end));
    T* to = samples.data() + row * static_cast<std::size_t>(y);
    if (!open.input->read_scanlines(0, 0, first + y, first + end, 0, 0, channels, type, to) ||
        open.input->has_error())
      fail_pixels(
          image, open,
          "rows " + std::to_string(y) + " to " + std::to_string(end - 1) + " of " + std::to_string(height));
  }
  return samples;
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

Pixels decode_jpeg_pixels(const Image& image) {
  Pixels pixels{image.width_px, image.height_px, image.channels, {}};
  const std::size_t row_bytes = static_cast<std::size_t>(image.width_px) * image.channels;
  // Reserved, not filled: memory is touched row by row, so that a header that lies costs nothing.
  pixels.data.reserve(row_bytes * image.height_px);
  decode_jpeg(image.name, image.bytes,
              [&](const std::uint8_t* row) { pixels.data.insert(pixels.data.end(), row, row + row_bytes); });
  return pixels;
}

void check_png_unchanged(const Image& image) {
  const PngHeader header = read_png_header(image.name, image.bytes);
  if (header.width_px != image.width_px || header.height_px != image.height_px ||
      header.channels != image.channels || header.bits != image.bits_per_channel)
    throw InputError(image.name, "PNG header", "the size that import had found", "another one");
}

// Every sample of a PNG, 16-bit ones as words.
template <class T>
std::vector<T> read_png(const Image& image) {
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

void check_jpeg_unchanged(const Image& image) {
  const JpegHeader header = read_jpeg_header(image.name, image.bytes);
  if (header.width_px != image.width_px || header.height_px != image.height_px ||
      header.channels != image.channels)
    throw InputError(image.name, "JPEG header", "the size that import had found", "another one");
}

void take_words(const std::vector<std::uint16_t>& words, const ColourProfile* profile, Pixels& pixels) {
  pixels.data = bytes_from_words(words);
  if (profile) convert_to_srgb(*profile, words, pixels);
}

void take_floats(const std::vector<float>& values, FloatEncoding encoding, const ColourProfile* profile,
                 Pixels& pixels) {
  pixels.data = bytes_from_floats(values, pixels.channels, profile ? FloatEncoding::kAsIs : encoding);
  if (profile) convert_to_srgb(*profile, values, pixels);
}

/// Samples of 16 bits and floats go by `profile`, if any, before they are rounded.
Pixels decode_stored(const Image& image, FloatEncoding encoding, const ColourProfile* profile) {
  if (image.format == ImageFormat::kJpeg) {
    check_jpeg_unchanged(image);
    return decode_jpeg_pixels(image);
  }
  Pixels pixels{image.width_px, image.height_px, image.channels, {}};
  if (image.format == ImageFormat::kWebp) {
    pixels.data = decode_webp(image);
    return pixels;
  }
  if (image.format == ImageFormat::kPng) {
    check_png_unchanged(image);
    if (image.bits_per_channel == 16)
      take_words(read_png<std::uint16_t>(image), profile, pixels);
    else
      pixels.data = read_png<std::uint8_t>(image);
    return pixels;
  }
  OpenImage open = open_checked(image);
  switch (bits_of(open.spec)) {
    case 8:
      pixels.data = read_samples<std::uint8_t>(image, open, OIIO::TypeDesc::UINT8);
      break;
    case 16:
      take_words(read_samples<std::uint16_t>(image, open, OIIO::TypeDesc::UINT16), profile, pixels);
      break;
    default:
      take_floats(read_samples<float>(image, open, OIIO::TypeDesc::FLOAT), encoding, profile, pixels);
  }
  return pixels;
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

const char* image_format_name(ImageFormat format) {
  switch (format) {
    case ImageFormat::kJpeg:
      return "JPEG";
    case ImageFormat::kPng:
      return "PNG";
    case ImageFormat::kTiff:
      return "TIFF";
    case ImageFormat::kWebp:
      return "WebP";
    case ImageFormat::kExr:
      return "EXR";
  }
  return "";
}

const char* image_extension(ImageFormat format) {
  switch (format) {
    case ImageFormat::kJpeg:
      return "jpg";
    case ImageFormat::kPng:
      return "png";
    case ImageFormat::kTiff:
      return "tif";
    case ImageFormat::kWebp:
      return "webp";
    case ImageFormat::kExr:
      return "exr";
  }
  return "";
}

std::optional<ImageFormat> sniff_image_format(std::span<const std::uint8_t> bytes) {
  auto has = [bytes](std::size_t at, std::string_view magic) {
    return bytes.size() >= at + magic.size() && !std::memcmp(bytes.data() + at, magic.data(), magic.size());
  };
  using namespace std::string_view_literals;
  if (has(0, "\xff\xd8\xff"sv)) return ImageFormat::kJpeg;
  if (has(0, "\x89PNG\r\n\x1a\n"sv)) return ImageFormat::kPng;
  if (has(0, "II*\0"sv) || has(0, "MM\0*"sv) || has(0, "II+\0"sv) || has(0, "MM\0+"sv))
    return ImageFormat::kTiff;
  if (has(0, "RIFF"sv) && has(8, "WEBP"sv)) return ImageFormat::kWebp;
  if (has(0, "\x76\x2f\x31\x01"sv)) return ImageFormat::kExr;
  return std::nullopt;
}

Image probe_image(std::string name, std::vector<std::uint8_t> bytes, const ImageLimits& limits) {
  const std::optional<ImageFormat> format = sniff_image_format(bytes);
  if (!format) throw InputError(name, "first bytes", "JPEG, PNG, TIFF, WebP or EXR", first_bytes(bytes));
  Image image;
  image.format = *format;
  if (*format == ImageFormat::kJpeg) {
    const JpegHeader header = read_jpeg_header(name, bytes);
    check_size(name, header.width_px, header.height_px, limits);
    image.width_px = header.width_px;
    image.height_px = header.height_px;
    image.channels = static_cast<std::uint8_t>(header.channels);
    image.bits_per_channel = 8;
  } else if (*format == ImageFormat::kPng) {
    const PngHeader header = read_png_header(name, bytes);
    check_size(name, header.width_px, header.height_px, limits);
    image.width_px = header.width_px;
    image.height_px = header.height_px;
    image.channels = static_cast<std::uint8_t>(header.channels);
    image.bits_per_channel = static_cast<std::uint8_t>(header.bits);
  } else if (*format == ImageFormat::kWebp) {
    const WebPBitstreamFeatures features = read_webp_header(name, bytes);
    image.width_px = static_cast<std::uint32_t>(features.width);
    image.height_px = static_cast<std::uint32_t>(features.height);
    check_size(name, image.width_px, image.height_px, limits);
    image.channels = features.has_alpha ? 4 : 3;
    image.bits_per_channel = 8;
  } else {
    const std::string colours = read_image_metadata(*format, bytes).foreign_colours;
    if (!colours.empty())
      throw InputError(name, "image header", "grey, RGB, palette, YCbCr or CMYK (convert it to sRGB)",
                       colours);
    const OpenImage open = open_image(name, *format, bytes);
    check_spec(name, open.spec, limits);
    image.width_px = static_cast<std::uint32_t>(open.spec.width);
    image.height_px = static_cast<std::uint32_t>(open.spec.height);
    image.channels = static_cast<std::uint8_t>(colour_channels(open.spec, *format));
    image.bits_per_channel = bits_of(open.spec);
  }
  image.name = std::move(name);
  image.bytes = std::move(bytes);
  return image;
}

Pixels decode_image(const Image& image, FloatEncoding encoding) {
  std::optional<ColourProfile> profile;  // found first: one that is refused need not wait for the pixels
  if (encoding == FloatEncoding::kSrgb && image.honour_profile) profile = honoured_profile(image);
  Pixels pixels = decode_stored(image, encoding, profile ? &*profile : nullptr);
  if (profile && image.bits_per_channel <= 8) convert_to_srgb(*profile, pixels);
  return pixels;
}

bool changes_colours(const Image& image, FloatEncoding encoding) {
  if (image.bits_per_channel > 16 || read_image_metadata(image.format, image.bytes).cmyk) return true;
  return encoding == FloatEncoding::kSrgb && image.honour_profile && honoured_profile(image).has_value();
}

FloatPixels decode_float(const Image& image) {
  FloatPixels pixels{image.width_px, image.height_px, image.channels, {}};
  auto widen = [&pixels](const auto& samples) { pixels.data.assign(samples.begin(), samples.end()); };
  if (image.format == ImageFormat::kPng && image.bits_per_channel == 16) {
    check_png_unchanged(image);
    widen(read_png<std::uint16_t>(image));
    return pixels;
  }
  if (image.format != ImageFormat::kTiff && image.format != ImageFormat::kExr) {
    widen(decode_image(image).data);
    return pixels;
  }
  OpenImage open = open_checked(image);
  switch (bits_of(open.spec)) {
    case 8:
      widen(read_samples<std::uint8_t>(image, open, OIIO::TypeDesc::UINT8));
      break;
    case 16:
      widen(read_samples<std::uint16_t>(image, open, OIIO::TypeDesc::UINT16));
      break;
    default:
      pixels.data = read_samples<float>(image, open, OIIO::TypeDesc::FLOAT);
  }
  return pixels;
}

}  // namespace texmesh
