#include "stages/image/image_metadata.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <string_view>

#include "format/base/bytes.h"
#include "stages/image/decode_tiff_exr.h"
#include "stages/image/jpeg_segments.h"

namespace texmesh {
namespace {

constexpr std::size_t kMaxProfile = 16u << 20;

/// ByteSpan from `at`, `count` of them or none.
ByteSpan part(ByteSpan bytes, std::size_t at, std::size_t count) {
  if (at > bytes.size() || count > bytes.size() - at) return {};
  return bytes.subspan(at, count);
}

std::uint32_t big(ByteSpan b) {
  std::uint32_t x = 0;
  for (std::uint8_t byte : b) x = x << 8 | byte;
  return x;
}

std::uint32_t little(ByteSpan b) {
  std::uint32_t x = 0;
  for (std::size_t i = b.size(); i-- > 0;) x = x << 8 | b[i];
  return x;
}

bool begins(ByteSpan bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && !std::memcmp(bytes.data(), magic.data(), magic.size());
}

/// Nothing, or too much, where one should be is a damaged one.
void read_profile(ByteSpan profile, ImageMetadata& out) {
  if (profile.size() <= kMaxProfile) out.icc_profile.assign(profile.begin(), profile.end());
  out.damaged_profile = out.icc_profile.empty();
}

// --- TIFF, which EXIF is too ---------------------------------------------------------------------------

/// The first directory; of BigTIFF too, whose counts and offsets have eight bytes.
class Tiff {
 public:
  explicit Tiff(ByteSpan bytes) : bytes_(bytes), little_(begins(bytes, "II")) {
    constexpr std::uint64_t kClassic = 42, kBig = 43;
    if (bytes.size() < 16 || !(little_ || begins(bytes, "MM"))) return;
    const std::uint64_t magic = number(2, 2);
    big_ = magic == kBig;
    if (magic == kClassic || big_) directory_ = big_ ? number(8, 8) : number(4, 4);
  }
  /// Where the entry of `tag` stands; 0 = nowhere.
  std::size_t entry(std::uint32_t tag) const {
    if (directory_ == 0) return 0;
    const std::size_t head = big_ ? 8 : 2, size = big_ ? 20 : 12;
    const std::uint64_t count = number(directory_, head);
    std::size_t at = directory_ + head;
    for (std::uint64_t i = 0; i < count && !part(bytes_, at, size).empty(); ++i, at += size)
      if (number(at, 2) == tag) return at;
    return 0;
  }
  /// Another directory, so another picture, follows.
  bool more() const {
    if (directory_ == 0) return false;
    const std::size_t head = big_ ? 8 : 2, size = big_ ? 20 : 12;
    const std::uint64_t count = number(directory_, head);
    if (count > bytes_.size() / size) return false;
    const std::uint64_t next = number(directory_ + head + count * size, big_ ? 8 : 4);
    return next != 0 && next != directory_ && next < bytes_.size();
  }
  /// Of an entry with one number of two bytes.
  std::uint32_t short_value(std::size_t entry) const {
    return static_cast<std::uint32_t>(number(entry + (big_ ? 12 : 8), 2));
  }
  /// Of an entry with so many bytes that they stand elsewhere.
  ByteSpan far_value(std::size_t entry) const {
    return big_ ? part(bytes_, number(entry + 12, 8), number(entry + 4, 8))
                : part(bytes_, number(entry + 8, 4), number(entry + 4, 4));
  }

 private:
  std::uint64_t number(std::size_t at, std::size_t count) const {
    const ByteSpan b = part(bytes_, at, count);
    std::uint64_t x = 0;
    for (std::size_t i = 0; i < b.size(); ++i) x = x << 8 | b[little_ ? b.size() - 1 - i : i];
    return x;
  }

  ByteSpan bytes_;
  bool little_, big_ = false;
  std::size_t directory_ = 0;
};

void read_orientation(ByteSpan tiff_bytes, ImageMetadata& out) {
  constexpr std::uint32_t kOrientation = 0x112;
  const Tiff tiff(tiff_bytes);
  const std::size_t at = tiff.entry(kOrientation);
  if (at == 0) return;
  const std::uint32_t value = tiff.short_value(at);
  if (value >= 1 && value <= 8) out.orientation = static_cast<int>(value);
}

void read_exif(ByteSpan exif, ImageMetadata& out) {
  constexpr std::string_view kHeader("Exif\0\0", 6);
  read_orientation(begins(exif, kHeader) ? exif.subspan(kHeader.size()) : exif, out);
}

/// Of the photometric interpretations that libtiff knows, those whose values are no plain colours. Nothing
/// for white or black is zero, RGB, palette, CMYK, YCbCr.
std::string foreign_name(std::uint32_t photometric) {
  switch (photometric) {
    case 0:
    case 1:
    case 2:
    case 3:
    case 5:
    case 6:
      return "";
    case 8:
    case 9:
    case 10:
      return "CIE L*a*b*";
    case 32844:
    case 32845:
      return "CIE log L";
    case 32803:
    case 34892:
      return "raw camera data";
    default:
      return "photometric interpretation " + std::to_string(photometric);
  }
}

void read_tiff(ByteSpan bytes, ImageMetadata& out) {
  constexpr std::uint32_t kProfile = 34675, kPhotometric = 262, kSeparated = 5;
  read_orientation(bytes, out);
  const Tiff tiff(bytes);
  out.more_pictures = tiff.more();
  if (const std::size_t at = tiff.entry(kProfile)) {
    read_profile(tiff.far_value(at), out);
  }
  if (const std::size_t at = tiff.entry(kPhotometric)) {
    const std::uint32_t colours = tiff.short_value(at);
    out.cmyk = colours == kSeparated;
    out.foreign_colours = foreign_name(colours);
  }
}

// --- JPEG ----------------------------------------------------------------------------------------------

void read_jpeg(ByteSpan bytes, ImageMetadata& out) {
  constexpr std::string_view kIcc("ICC_PROFILE\0", 12);
  std::map<std::uint8_t, ByteSpan> profile;  // its pieces by number, from 1
  std::uint8_t pieces = 0;
  for_each_jpeg_segment(bytes, [&](std::uint8_t marker, ByteSpan body) {
    if (marker == 0xe1 && begins(body, "Exif")) read_exif(body, out);
    if (marker == 0xe2 && begins(body, kIcc)) {
      out.damaged_profile = true;  // until all pieces are there
      if (body.size() > kIcc.size() + 2) {
        profile[body[kIcc.size()]] = body.subspan(kIcc.size() + 2);
        pieces = body[kIcc.size() + 1];
      }
    }
    if (is_jpeg_frame(marker) && body.size() > 5) out.cmyk = body[5] == 4;
  });
  if (profile.empty() || profile.size() != pieces || profile.begin()->first != 1 ||
      profile.rbegin()->first != pieces)
    return;
  for (const auto& [number, piece] : profile)
    out.icc_profile.insert(out.icc_profile.end(), piece.begin(), piece.end());
  out.damaged_profile = false;
}

// --- PNG -----------------------------------------------------------------------------------------------

std::vector<std::uint8_t> inflate_profile(ByteSpan body) {
  const auto name_end = std::find(body.begin(), body.end(), std::uint8_t{0});
  const std::size_t begin = static_cast<std::size_t>(name_end - body.begin()) + 2;  // and the method
  if (begin >= body.size()) return {};
  std::vector<std::uint8_t> out;
  for (uLongf size = 64u << 10; size <= kMaxProfile; size *= 16) {
    out.resize(size);
    uLongf written = size;
    const int result =
        uncompress(out.data(), &written, body.data() + begin, static_cast<uLong>(body.size() - begin));
    if (result == Z_BUF_ERROR && written == size) continue;
    out.resize(result == Z_OK ? written : 0);
    return out;
  }
  return {};
}

bool srgb_primaries(ByteSpan chrm) {
  constexpr double kSrgb[8] = {0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06};
  for (std::size_t i = 0; i < 8; ++i)
    if (std::fabs(big(chrm.subspan(4 * i, 4)) / 1e5 - kSrgb[i]) > 0.005) return false;
  return true;
}

void read_png_metadata(ByteSpan bytes, ImageMetadata& out) {
  constexpr std::uint32_t kSrgbGamma = 45455, kNear = 1000;
  bool srgb = false;
  for (std::size_t at = 8; at + 12 <= bytes.size();) {
    const std::size_t length = big(bytes.subspan(at, 4));
    const ByteSpan type = bytes.subspan(at + 4, 4), body = part(bytes, at + 8, length);
    if (body.size() != length && begins(type, "iCCP")) out.damaged_profile = true;
    if (body.size() != length || begins(type, "IDAT") || begins(type, "IEND")) break;
    if (begins(type, "sRGB")) srgb = true;
    if (begins(type, "iCCP")) read_profile(inflate_profile(body), out);
    if (begins(type, "eXIf")) read_exif(body, out);
    if (begins(type, "acTL") && length == 8) out.more_pictures = big(body.first(4)) > 1;
    if (begins(type, "cHRM") && length == 32) out.other_primaries = !srgb_primaries(body);
    if (begins(type, "gAMA") && length == 4) {
      const std::uint32_t g = big(body);
      if (g > 0 && (g < kSrgbGamma - kNear || g > kSrgbGamma + kNear)) out.gamma = g / 1e5;
    }
    at += 12 + length;
  }
  if (srgb) out.damaged_profile = false;
  if (srgb || !out.icc_profile.empty()) out.gamma = 0, out.other_primaries = false;
}

// --- WebP ----------------------------------------------------------------------------------------------

void read_webp(ByteSpan bytes, ImageMetadata& out) {
  for (std::size_t at = 12; at + 8 <= bytes.size();) {
    const std::size_t length = little(bytes.subspan(at + 4, 4));
    const ByteSpan type = bytes.subspan(at, 4), body = part(bytes, at + 8, length);
    if (begins(type, "ICCP")) read_profile(body, out);
    if (body.size() != length) break;
    if (begins(type, "EXIF")) read_exif(body, out);
    at += 8 + length + length % 2;
  }
}

// --- EXR -----------------------------------------------------------------------------------------------

bool rec709_primaries(ByteSpan chromaticities) {
  constexpr float kRec709[8] = {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f};
  for (std::size_t i = 0; i < 8; ++i)
    if (!(std::fabs(std::bit_cast<float>(little(chromaticities.subspan(4 * i, 4))) - kRec709[i]) <= 0.005f))
      return false;
  return true;
}

void read_exr(ByteSpan bytes, ImageMetadata& out) {
  constexpr std::uint32_t kParts = 0x1000;
  out.more_pictures = little(part(bytes, 4, 4)) & kParts;
  for_each_exr_attribute(bytes, [&](std::size_t number, const ExrAttribute& a) {
    if (number == 0 && a.name == "chromaticities" && a.type == a.name && a.value.size() == 32)
      out.other_primaries = !rec709_primaries(a.value);
  });
}

}  // namespace

ImageMetadata read_image_metadata(ImageFormat format, std::span<const std::uint8_t> bytes) {
  ImageMetadata out;
  switch (format) {
    case ImageFormat::kJpeg:
      read_jpeg(bytes, out);
      break;
    case ImageFormat::kPng:
      read_png_metadata(bytes, out);
      break;
    case ImageFormat::kTiff:
      read_tiff(bytes, out);
      break;
    case ImageFormat::kWebp:
      read_webp(bytes, out);
      break;
    case ImageFormat::kExr:
      read_exr(bytes, out);
      break;
  }
  return out;
}

}  // namespace texmesh
