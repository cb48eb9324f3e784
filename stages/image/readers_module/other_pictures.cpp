#include <cstdio>
#include <type_traits>

#include "stages/image/avif.h"
#include "stages/image/png_writer.h"
#include "stages/image/readers_module/other_pictures.h"

namespace texmesh {
namespace {

constexpr std::size_t kTgaHead = 18;

bool has(ByteSpan bytes, std::size_t at, std::string_view magic) {
  return bytes.size() >= at + magic.size() && !std::memcmp(bytes.data() + at, magic.data(), magic.size());
}

std::uint32_t number_at(ByteSpan bytes, std::size_t at, std::size_t n) {  // little-endian
  if (at + n > bytes.size()) return 0;
  std::uint32_t value = 0;
  for (std::size_t i = n; i-- > 0;) value = value << 8 | bytes[at + i];
  return value;
}

bool is_tga(const std::string& name, ByteSpan bytes) {
  if (bytes.size() < kTgaHead) return false;
  const std::string_view extension =
      std::string_view(name).substr(name.size() - std::min<std::size_t>(4, name.size()));
  if (extension != ".tga" && extension != ".TGA" && extension != ".Tga") return false;
  const unsigned palette = bytes[1], kind = bytes[2] & 7u, bits = bytes[16];
  const bool known_kind = (bytes[2] & ~8u) == kind && kind >= 1 && kind <= 3 && palette <= 1;
  return known_kind && (bits == 8 || bits == 15 || bits == 16 || bits == 24 || bits == 32);
}

/// The start of the codestream, and in it that of the marker SIZ (ISO/IEC 15444-1, A.5.1).
ByteSpan jpeg2000_size_marker(ByteSpan bytes) {
  constexpr std::uint8_t kStart[] = {0xff, 0x4f, 0xff, 0x51};
  const auto at = std::search(bytes.begin(), bytes.end(), std::begin(kStart), std::end(kStart));
  return bytes.subspan(static_cast<std::size_t>(at - bytes.begin()));
}

PictureSize size_of_jpeg2000(const std::string& name, ByteSpan bytes) {
  constexpr std::size_t kMarkerBytes = 42, kLeastTile = 14;
  const ByteSpan marker = jpeg2000_size_marker(bytes);
  if (marker.size() < kMarkerBytes) throw InputError(name, "image header", "a size of JPEG 2000", "none");
  const auto at = [&](std::size_t i) {
    return std::uint64_t{marker[i]} << 24 | marker[i + 1] << 16 | marker[i + 2] << 8 | marker[i + 3];
  };
  const std::uint64_t right = at(8), bottom = at(12), left = at(16), top = at(20);
  const std::uint64_t tile_width = at(24), tile_height = at(28),
                      channels = std::uint64_t{marker[40]} << 8 | marker[41];
  if (left >= right || top >= bottom || tile_width == 0 || tile_height == 0)
    throw InputError(name, "image header", "a size of JPEG 2000", "nothing between its edges");
  // OpenJPEG takes kilobytes for each tile when it opens a file.
  const std::uint64_t tiles = (right / tile_width + 1) * (bottom / tile_height + 1);
  if (tiles > 4 + bytes.size() / kLeastTile || channels > 64)
    throw InputError(name, "image header", "tiles that its bytes can hold, and at most 64 channels",
                     std::to_string(tiles) + " tiles in " + std::to_string(channels) + " channels");
  return {static_cast<std::uint32_t>(right - left), static_cast<std::uint32_t>(bottom - top)};
}

PictureSize size_of_hdr(const std::string& name, ByteSpan bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::size_t end = text.find("\n\n");
  PictureSize size;
  if (end != text.npos)
    std::sscanf(std::string(text.substr(end + 2, 40)).c_str(), "-Y %9u +X %9u", &size.height_px,
                &size.width_px);
  if (size.width_px == 0)
    throw InputError(name, "image header", "rows from the top, as in \"-Y 512 +X 1024\"", "another line");
  return size;
}

PictureSize size_of(const std::string& name, OtherPicture kind, ByteSpan bytes) {
  const auto pair = [&](std::size_t width_at, std::size_t height_at, std::size_t n) {
    return PictureSize{number_at(bytes, width_at, n), number_at(bytes, height_at, n)};
  };
  switch (kind) {
    case OtherPicture::kBmp: {
      constexpr std::uint32_t kOs2Head = 12;
      if (number_at(bytes, 14, 4) == kOs2Head) return pair(18, 20, 2);
      const PictureSize size = pair(18, 22, 4);  // below 0: rows from the top
      const auto rows = static_cast<std::int32_t>(size.height_px);
      return {size.width_px, rows < 0 ? 0u - size.height_px : size.height_px};
    }
    case OtherPicture::kTga:
      return pair(12, 14, 2);
    case OtherPicture::kGif:
      return pair(6, 8, 2);
    case OtherPicture::kDds: {
      constexpr std::uint32_t kCube = 0x200, kVolume = 0x200000;
      if (number_at(bytes, 112, 4) & (kCube | kVolume))
        throw InputError(name, "image header", "a flat picture", "a cube or a volume");
      return pair(16, 12, 4);
    }
    case OtherPicture::kJpeg2000:
      return size_of_jpeg2000(name, bytes);
    case OtherPicture::kHdr:
      return size_of_hdr(name, bytes);
    case OtherPicture::kAvif:
      break;  // decode_avif() checks it
  }
  return {};
}

/// Takes channel `last` out of `n`.
template <class T>
void drop_channel(std::vector<T>& samples, std::uint32_t n) {
  std::size_t to = 0;
  for (std::size_t i = 0; i < samples.size(); ++i)
    if (i % n != n - 1) samples[to++] = samples[i];
  samples.resize(to);
}

/// Alpha that says nothing is dropped.
template <class T>
void drop_dull_alpha(std::vector<T>& samples, std::uint32_t& channels) {
  const T opaque = std::is_floating_point_v<T> ? T{1} : std::numeric_limits<T>::max();
  bool all_clear = true, all_opaque = true;
  for (std::size_t i = channels - 1; i < samples.size(); i += channels) {
    all_clear = all_clear && samples[i] == 0;
    all_opaque = all_opaque && samples[i] == opaque;
  }
  if (all_clear || all_opaque) drop_channel(samples, channels--);
}

/// A TIFF without compression, in one strip.
template <class T>
Bytes tiff_of(const PictureSize& size, std::uint32_t channels, const std::vector<T>& samples) {
  constexpr std::uint32_t kShort = 3, kLong = 4, kBits = 8 * sizeof(T), kSeparateAlpha = 2;
  constexpr std::uint32_t kSampleFormat = std::is_floating_point_v<T> ? 3 : 1;
  const bool alpha = channels % 2 == 0;
  const std::uint32_t entries = alpha ? 12 : 11, lists_at = 8 + 2 + 12 * entries + 4,
                      pixels_at = lists_at + 16;
  BytesOut out;
  out.text("II"), out.u16(42), out.u32(8), out.u16(entries);
  const auto entry = [&](std::uint32_t tag, std::uint32_t type, std::uint32_t count, std::uint32_t value) {
    out.u16(tag), out.u16(type), out.u32(count), out.u32(value);
  };
  const auto for_channels = [&](std::uint32_t tag, std::uint32_t value, std::uint32_t list_at) {
    entry(tag, kShort, channels, channels > 2 ? list_at : value * 0x10001);
  };
  entry(256, kLong, 1, size.width_px), entry(257, kLong, 1, size.height_px);
  for_channels(258, kBits, lists_at);
  entry(259, kShort, 1, 1), entry(262, kShort, 1, channels >= 3 ? 2 : 1);
  entry(273, kLong, 1, pixels_at), entry(277, kShort, 1, channels), entry(278, kLong, 1, size.height_px);
  entry(279, kLong, 1, static_cast<std::uint32_t>(samples.size() * sizeof(T))), entry(284, kShort, 1, 1);
  if (alpha) entry(338, kShort, 1, kSeparateAlpha);
  for_channels(339, kSampleFormat, lists_at + 8);
  out.u32(0);
  for (const std::uint32_t value : {kBits, kSampleFormat})
    for (int i = 0; i < 4; ++i) out.u16(value);
  Bytes file = out.finish();
  const auto* data = reinterpret_cast<const std::uint8_t*>(samples.data());
  file.insert(file.end(), data, data + samples.size() * sizeof(T));
  return file;
}

/// PNGs are written with 1, 3 or 4 channels.
Bytes png_of(const PictureSize& size, std::uint32_t channels, std::vector<std::uint8_t> samples) {
  if (channels == 2) {
    std::vector<std::uint8_t> four;
    four.reserve(2 * samples.size());
    for (std::size_t i = 0; i < samples.size(); i += 2)
      four.insert(four.end(), {samples[i], samples[i], samples[i], samples[i + 1]});
    samples = std::move(four), channels = 4;
  }
  constexpr int kFast = 1;  // the file is seldom kept
  return write_png({size.width_px, size.height_px, channels, std::move(samples)}, {.level = kFast});
}

}  // namespace

std::optional<OtherPicture> sniff_other_picture(const std::string& name, ByteSpan bytes) {
  using namespace std::string_view_literals;
  if (has(bytes, 0, "BM"sv) && bytes.size() > 26) return OtherPicture::kBmp;
  if (has(bytes, 0, "GIF87a"sv) || has(bytes, 0, "GIF89a"sv)) return OtherPicture::kGif;
  if (has(bytes, 0, "DDS \x7c\0\0\0"sv)) return OtherPicture::kDds;
  if (has(bytes, 0, "\0\0\0\x0cjP  \r\n\x87\n"sv) || has(bytes, 0, "\xff\x4f\xff\x51"sv))
    return OtherPicture::kJpeg2000;
  if (has(bytes, 0, "#?RADIANCE"sv) || has(bytes, 0, "#?RGBE"sv)) return OtherPicture::kHdr;
  if (is_avif(bytes)) return OtherPicture::kAvif;
  if (is_tga(name, bytes)) return OtherPicture::kTga;
  return std::nullopt;
}

namespace {

/// By OpenImageIO; `size` becomes the picture's.
PictureSamples read_by_module(const std::string& name, OtherPicture kind, ByteSpan bytes,
                              const ImageLimits& limits, PictureSize& size) {
  size = size_of(name, kind, bytes);
  check_image_size(name, size.width_px, size.height_px, limits);
  // No packer of these kinds shrinks a picture with any noise further.
  const std::uint64_t most_shrunk = kind == OtherPicture::kJpeg2000 ? 20000 : 3000;
  if (std::uint64_t{size.width_px} * size.height_px / most_shrunk > bytes.size())
    throw InputError(name, "image header",
                     "a size that its " + std::to_string(bytes.size()) + " bytes can hold",
                     std::to_string(size.width_px) + " x " + std::to_string(size.height_px));
  return module_readers(name, other_picture_name(kind), "libopenimageio2.4")
      .read_picture(name, kind, bytes, size);
}

PictureSamples read_avif(const std::string& name, ByteSpan bytes, const ImageLimits& limits,
                         PictureSize& size) {
  AvifPicture picture = decode_avif(name, bytes, limits);
  size = {picture.width_px, picture.height_px};
  PictureSamples out{picture.channels, picture.more_pictures, picture.profile, {}};
  std::visit([&](auto& samples) { out.samples = std::move(samples); }, picture.samples);
  return out;
}

}  // namespace

ConvertedPicture convert_other_picture(const std::string& name, OtherPicture kind, ByteSpan bytes,
                                       const ImageLimits& limits) {
  PictureSize size;
  PictureSamples picture = kind == OtherPicture::kAvif ? read_avif(name, bytes, limits, size)
                                                       : read_by_module(name, kind, bytes, limits, size);
  ConvertedPicture out;
  out.more_pictures = picture.more_pictures;
  out.profile = picture.profile;
  std::visit(
      [&](auto& samples) {
        if (picture.channels % 2 == 0) drop_dull_alpha(samples, picture.channels);
        using T = typename std::decay_t<decltype(samples)>::value_type;
        constexpr std::size_t kMostTiff = 4'000'000'000;
        if (sizeof(T) > 1 && samples.size() > kMostTiff / sizeof(T))
          throw InputError(name, "image header", "samples of less than 4 GB", std::to_string(samples.size()));
        if constexpr (sizeof(T) == 1)
          out.bytes = png_of(size, picture.channels, std::move(samples));
        else
          out.bytes = tiff_of(size, picture.channels, samples);
      },
      picture.samples);
  return out;
}

}  // namespace texmesh
