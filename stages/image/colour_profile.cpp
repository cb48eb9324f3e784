#include "stages/image/colour_profile.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "format/base/portable_math.h"
#include "format/base/srgb.h"

namespace texmesh {
namespace {

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
  static std::uint32_t u32_of(ByteSpan b, std::size_t at) {
    return static_cast<std::uint32_t>(b[at]) << 24 | static_cast<std::uint32_t>(b[at + 1]) << 16 |
           static_cast<std::uint32_t>(b[at + 2]) << 8 | b[at + 3];
  }
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

/// sRGB codes of light, rounded as exactly as with the formula, by a table: the bucket's first code, then up
/// while the next code's lower border is reached.
class SrgbEncoder {
 public:
  SrgbEncoder() {
    for (std::size_t k = 1; k < 256; ++k) border_[k] = light_of_srgb((static_cast<double>(k) - 0.5) / 255);
    border_[256] = 2;
    std::uint8_t code = 0;
    for (std::size_t i = 0; i < kBuckets; ++i) {
      while (border_[code + std::size_t{1}] <= static_cast<double>(i) / kBuckets) ++code;
      first_[i] = code;
    }
  }
  std::uint8_t operator()(double light) const {
    if (!(light > 0)) return 0;
    if (light >= 1) return 255;
    std::uint8_t code = first_[static_cast<std::size_t>(light * kBuckets)];
    while (border_[code + std::size_t{1}] <= light) ++code;
    return code;
  }

 private:
  static constexpr std::size_t kBuckets = 4096;
  std::array<double, 257> border_{};
  std::array<std::uint8_t, kBuckets> first_{};
};

const SrgbEncoder& srgb_encoder() {
  static const SrgbEncoder encoder;
  return encoder;
}

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
  const SrgbEncoder& encode = srgb_encoder();
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
