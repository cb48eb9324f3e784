// What an image file says of itself, format by format, and the colour profiles among it.
#include "stages/image/image_metadata.h"

#include <zlib.h>

#include <cstdlib>
#include <map>

#include "stages/base/float_math.h"
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
  if (photometric <= 6 && photometric != 4) return "";
  if (photometric >= 8 && photometric <= 10) return "CIE L*a*b*";
  if (photometric == 32844 || photometric == 32845) return "CIE log L";
  if (photometric == 32803 || photometric == 34892) return "raw camera data";
  return "photometric interpretation " + std::to_string(photometric);
}

void read_tiff(ByteSpan bytes, ImageMetadata& out) {
  constexpr std::uint32_t kProfile = 34675, kPhotometric = 262, kSeparated = 5;
  read_orientation(bytes, out);
  const Tiff tiff(bytes);
  out.more_pictures = tiff.more();
  if (const std::size_t at = tiff.entry(kProfile)) read_profile(tiff.far_value(at), out);
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

using Matrix = std::array<std::array<double, 3>, 3>;

/// Columns: X, Y, Z (D50, as all profiles speak) of sRGB's red, green and blue at full light.
constexpr Matrix kSrgbToXyz{{{0.43606567, 0.38514709, 0.14307784},
                             {0.22248840, 0.71687317, 0.06060791},
                             {0.01391602, 0.09707642, 0.71409607}}};

Matrix inverse(const Matrix& m) {
  const auto minor = [&](std::size_t r, std::size_t c) {
    const std::size_t a = (r + 1) % 3, b = (r + 2) % 3, i = (c + 1) % 3, j = (c + 2) % 3;
    return m[a][i] * m[b][j] - m[a][j] * m[b][i];
  };
  const double determinant = m[0][0] * minor(0, 0) + m[0][1] * minor(0, 1) + m[0][2] * minor(0, 2);
  Matrix out{};
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) out[c][r] = minor(r, c) / determinant;
  return out;
}

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix out{};
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) out[r][c] = a[r][0] * b[0][c] + a[r][1] * b[1][c] + a[r][2] * b[2][c];
  return out;
}

double power(double base, double exponent) { return base > 0 ? portable::pow(base, exponent) : 0; }

/// The profile's tags, every offset checked.
class IccReader {
 public:
  IccReader(const std::string& name, ByteSpan bytes, std::size_t codes)
      : name_(name), bytes_(bytes), codes_(codes) {
    if (bytes.size() < 132 || text(36) != "acsp") fail("an ICC profile", "other bytes");
    if (u32(128) > 200) fail("at most 200 tags", std::to_string(u32(128)));
  }

  [[noreturn]] void fail(const std::string& expected, const std::string& found) const {
    throw InputError(name_, "colour profile", expected, found);
  }
  std::string text(std::size_t at) const {
    const ByteSpan b = part(at, 4);
    std::string s(b.begin(), b.end());
    for (char& c : s)
      if (c < ' ' || c > '~') c = '?';
    return s;
  }
  bool has(std::string_view tag) const { return find(tag) != 0; }

  /// Light per code.
  std::vector<double> curve(std::string_view tag) const {
    const ByteSpan data = tag_data(tag);
    std::vector<double> out(codes_);
    const std::string kind = text_of(data);
    if (kind == "curv") {
      fill(out, data);
    } else if (kind == "para") {
      fill_parametric(out, data);
    } else {
      fail("a curve for " + std::string(tag), kind);
    }
    for (double& x : out) x = std::clamp(x, 0.0, 1.0);
    return out;
  }

  std::array<double, 3> xyz(std::string_view tag) const {
    const ByteSpan data = tag_data(tag);
    if (text_of(data) != "XYZ " || data.size() < 20) fail("X, Y, Z for " + std::string(tag), text_of(data));
    return {fixed(data, 8), fixed(data, 12), fixed(data, 16)};
  }

 private:
  ByteSpan part(std::size_t at, std::size_t count) const {
    if (at > bytes_.size() || count > bytes_.size() - at)
      fail("a whole ICC profile", "one that ends after " + std::to_string(bytes_.size()) + " bytes");
    return bytes_.subspan(at, count);
  }
  std::uint32_t u32(std::size_t at) const { return u32_of(part(at, 4), 0); }
  static std::uint32_t u32_of(ByteSpan b, std::size_t at) { return big(b.subspan(at, 4)); }
  static double fixed(ByteSpan b, std::size_t at) {
    return static_cast<std::int32_t>(u32_of(b, at)) / 65536.0;
  }
  static std::string text_of(ByteSpan b) { return b.size() < 4 ? "" : std::string(b.begin(), b.begin() + 4); }
  std::size_t find(std::string_view tag) const {
    for (std::uint32_t i = 0, n = u32(128); i < n; ++i) {
      const std::size_t at = 132 + std::size_t{12} * i;
      if (!std::memcmp(part(at, 12).data(), tag.data(), 4)) return at;
    }
    return 0;
  }
  ByteSpan tag_data(std::string_view tag) const {
    const std::size_t at = find(tag);
    if (at == 0) fail("the tag " + std::string(tag), "none");
    const ByteSpan data = part(u32(at + 4), u32(at + 8));
    if (data.size() < 12) fail("12 bytes of " + std::string(tag), std::to_string(data.size()));
    return data;
  }

  void fill(std::vector<double>& out, ByteSpan data) const {
    const std::size_t count = u32_of(data, 8);
    if (count > (data.size() - 12) / 2) fail("a curve that fits its tag", std::to_string(count) + " points");
    const auto point = [&](std::size_t i) { return (data[12 + 2 * i] << 8 | data[13 + 2 * i]) / 65535.0; };
    for (std::size_t i = 0; i < out.size(); ++i) {
      const double x = static_cast<double>(i) / static_cast<double>(out.size() - 1);
      if (count == 0) {
        out[i] = x;
      } else if (count == 1) {
        out[i] = power(x, (data[12] << 8 | data[13]) / 256.0);
      } else {
        const double at = x * static_cast<double>(count - 1);
        const auto k = std::min(static_cast<std::size_t>(at), count - 2);
        out[i] = point(k) + (point(k + 1) - point(k)) * (at - static_cast<double>(k));
      }
    }
  }

  /// Five forms: (a x + b) ^ g + e from d on, c x + f below; those that say less leave e, f, c or more out.
  void fill_parametric(std::vector<double>& out, ByteSpan data) const {
    constexpr std::size_t kParameters[] = {1, 3, 4, 5, 7};
    const std::size_t form = static_cast<std::size_t>(data[8] << 8 | data[9]);
    if (form > 4 || data.size() < 12 + 4 * kParameters[form])
      fail("a parametric curve of forms 0 to 4", "form " + std::to_string(form));
    double p[7] = {1, 1, 0, 0, 0, 0, 0};
    for (std::size_t i = 0; i < kParameters[form]; ++i) p[i] = fixed(data, 12 + 4 * i);
    const double g = p[0], a = p[1], b = p[2];
    double c = p[3], d = p[4], e = p[5], f = p[6];
    if (form == 1 || form == 2) {  // zero, or c, below -b/a
      e = f = form == 2 ? p[3] : 0;
      c = 0;
      d = a != 0 ? -b / a : 0;
    }
    if (form == 0) d = 0;
    for (std::size_t i = 0; i < out.size(); ++i) {
      const double x = static_cast<double>(i) / static_cast<double>(out.size() - 1);
      out[i] = x >= d ? power(a * x + b, g) + e : c * x + f;
    }
  }

  const std::string& name_;
  ByteSpan bytes_;
  std::size_t codes_;
};

template <class Code>  // of std::uint8_t or std::uint16_t, an index of the curves
double light_of(const std::vector<double>& curve, Code code) {
  return curve[code];
}
double light_of(const std::vector<double>& curve, float value) {
  if (!(value > 0)) return curve.front();  // NaN too
  const double at = std::min(1.0, static_cast<double>(value)) * static_cast<double>(curve.size() - 1);
  const auto k = std::min(static_cast<std::size_t>(at), curve.size() - 2);
  return curve[k] + (curve[k + 1] - curve[k]) * (at - static_cast<double>(k));
}

template <class Sample>
void convert_texel(const ColourProfile& profile, const Sample* in, std::uint8_t* out) {
  static const SrgbEncoder<double, false> encode;
  if (profile.grey) {
    out[0] = encode(light_of(profile.curve[0], in[0]));
    return;
  }
  const double light[3] = {light_of(profile.curve[0], in[0]), light_of(profile.curve[1], in[1]),
                           light_of(profile.curve[2], in[2])};
  for (std::size_t c = 0; c < 3; ++c) {
    const std::array<double, 3>& row = profile.to_srgb[c];
    out[c] = encode(row[0] * light[0] + row[1] * light[1] + row[2] * light[2]);
  }
}

template <class Sample>
void convert_all(const ColourProfile& profile, const Sample* in, Pixels& pixels) {
  const std::size_t texels = std::size_t{pixels.width_px} * pixels.height_px;
  std::uint8_t* p = pixels.data.data();
  std::uint8_t out[3];
  for (std::size_t i = 0; i < texels; ++i, in += pixels.channels, p += pixels.channels) {
    convert_texel(profile, in, out);
    std::memcpy(p, out, profile.grey ? 1 : 3);
  }
}

}  // namespace

ImageMetadata read_image_metadata(ImageFormat format, std::span<const std::uint8_t> bytes) {
  ImageMetadata out;
  constexpr std::array kReaders{read_jpeg, read_png_metadata, read_tiff, read_webp, read_exr};
  kReaders.at(static_cast<std::size_t>(format))(bytes, out);
  return out;
}

ColourProfile read_icc_profile(const std::string& name, std::span<const std::uint8_t> bytes,
                               std::uint32_t channels, std::size_t codes) {
  constexpr const char* kConvert = "RGB primaries with curves, or a grey curve (convert the image to sRGB)";
  const IccReader icc(name, bytes, codes);
  ColourProfile out;
  out.grey = channels <= 2;
  const std::string space = icc.text(16);
  if (space != (out.grey ? "GRAY" : "RGB "))
    icc.fail(std::string(kConvert) + ", as the image is " + (out.grey ? "grey" : "RGB"),
             "a profile for " + space);
  if (out.grey) {
    if (!icc.has("kTRC")) icc.fail(kConvert, "lookup tables");
    out.curve[0] = icc.curve("kTRC");
    return out;
  }
  Matrix to_xyz{};
  constexpr std::array<std::string_view, 3> kPrimaries{"rXYZ", "gXYZ", "bXYZ"},
      kCurves{"rTRC", "gTRC", "bTRC"};
  for (std::size_t c = 0; c < 3; ++c) {
    if (!icc.has(kPrimaries[c]) || !icc.has(kCurves[c])) icc.fail(kConvert, "lookup tables");
    out.curve[c] = icc.curve(kCurves[c]);
    const std::array<double, 3> xyz = icc.xyz(kPrimaries[c]);
    for (std::size_t r = 0; r < 3; ++r) to_xyz[r][c] = xyz[r];
  }
  out.to_srgb = product(inverse(kSrgbToXyz), to_xyz);
  return out;
}

ColourProfile gamma_profile(double gamma, std::uint32_t channels, std::size_t codes) {
  ColourProfile out;
  out.grey = channels <= 2;
  std::vector<double> curve(codes);
  for (std::size_t i = 0; i < codes; ++i)
    curve[i] = power(static_cast<double>(i) / static_cast<double>(codes - 1), 1 / gamma);
  out.curve = {curve, curve, curve};
  return out;
}

bool is_srgb(const ColourProfile& profile) {
  constexpr int kSame = 2;
  std::uint8_t in[3], out[3];
  std::size_t codes[3];
  const std::size_t step = (profile.curve[0].size() - 1) / 255;
  for (int i = 0; i < 256; ++i)  // greys, and the full range of each primary
    for (int kind = 0; kind < (profile.grey ? 1 : 4); ++kind) {
      for (int c = 0; c < 3; ++c) in[c] = static_cast<std::uint8_t>(kind == 0 || kind == c + 1 ? i : 128);
      for (int c = 0; c < 3; ++c) codes[c] = in[c] * step;
      convert_texel(profile, codes, out);
      for (int c = 0; c < (profile.grey ? 1 : 3); ++c)
        if (std::abs(in[c] - out[c]) > kSame) return false;
    }
  return true;
}

void convert_to_srgb(const ColourProfile& profile, Pixels& pixels) {
  convert_all(profile, pixels.data.data(), pixels);
}

void convert_to_srgb(const ColourProfile& profile, const std::vector<std::uint16_t>& samples,
                     Pixels& pixels) {
  convert_all(profile, samples.data(), pixels);
}

void convert_to_srgb(const ColourProfile& profile, const std::vector<float>& samples, Pixels& pixels) {
  convert_all(profile, samples.data(), pixels);
}

}  // namespace texmesh
