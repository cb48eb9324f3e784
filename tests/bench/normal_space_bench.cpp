// What each space for the coding of normal maps takes: normal_space_bench IMAGE ... . Prints bytes and mean
// angle of windows of 128 px spread over each image, coded as JPEGs in fragments' manner, for channels apart,
// channels apart with a coarse z, YCbCr 4:4:4, YCbCr 4:2:0, x and y alone (codec jpeg-xy, whose reader makes
// z), and, which no package has, x and y in two grey files. The last columns are bytes over those of channels
// apart and of the coarse z at equal angles.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <iterator>

#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/decode_image.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/masked_jpeg.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kWindowPx = 128;
constexpr std::size_t kMostWindows = 64;
constexpr std::array kQualities{30, 53, 75, 86, 93, 97, 100};
constexpr double kDegrees = 57.29577951308232;

struct Space {
  const char* name;
  JpegKind kind;
  bool without_z = false;
  bool two = false;  // x and y as two grey pictures
};

JpegKind kind_of(std::uint32_t channels, bool apart, bool coarse_last, Subsampling subsampling) {
  JpegKind kind;
  kind.channels = channels;
  kind.rgb = apart;
  kind.coarse_last = coarse_last;
  kind.subsampling = subsampling;
  return kind;
}

std::vector<Space> spaces() {
  const auto full = Subsampling::k444;
  return {{"channels apart", kind_of(3, true, false, full)},
          {"coarse z", kind_of(3, true, true, full)},
          {"YCbCr 4:4:4", kind_of(3, false, false, full)},
          {"YCbCr 4:2:0", kind_of(3, false, false, Subsampling::k420)},
          {"without z", kind_of(3, true, false, full), true},
          {"two grey files", kind_of(1, false, false, full), true, true}};
}

/// The first three channels of some windows.
std::vector<Pixels> windows_of(const Pixels& image) {
  const std::uint32_t across = image.width_px / kWindowPx, down = image.height_px / kWindowPx;
  const std::size_t all = std::size_t{across} * down, count = std::min(all, kMostWindows);
  std::vector<Pixels> out;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t at = k * all / count;
    Pixels& window = out.emplace_back(Pixels{kWindowPx, kWindowPx, 3, {}});
    for (std::uint32_t y = 0; y < kWindowPx; ++y)
      for (std::uint32_t x = 0; x < kWindowPx; ++x) {
        const std::uint8_t* texel = image.at(static_cast<std::uint32_t>(at % across) * kWindowPx + x,
                                             static_cast<std::uint32_t>(at / across) * kWindowPx + y);
        window.data.insert(window.data.end(), texel, texel + 3);
      }
  }
  return out;
}

Pixels channel_of(const Pixels& image, std::size_t channel) {
  Pixels out{image.width_px, image.height_px, 1, {}};
  for (std::size_t i = channel; i < image.data.size(); i += 3) out.data.push_back(image.data[i]);
  return out;
}

std::vector<PixelWindow> views_of(const std::vector<Pixels>& pictures) {
  std::vector<PixelWindow> out;
  for (const Pixels& p : pictures)
    out.push_back({p.data.data(), std::size_t{p.width_px} * p.channels, p.width_px, p.height_px, {}});
  return out;
}

/// A texel's vector, of unit length.
std::array<double, 3> vector_of(const std::uint8_t* texel) {
  std::array<double, 3> v{};
  double length = 0;
  for (std::size_t c = 0; c < 3; ++c) v[c] = 2.0 * texel[c] / 255 - 1, length += v[c] * v[c];
  for (double& x : v) x /= std::sqrt(length);  // 255 is odd, so that no vector is 0
  return v;
}

double angle(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
  return 2 * std::asin(std::min(1.0, std::sqrt(x * x + y * y + z * z) / 2)) * kDegrees;
}

struct Point {
  double bits = 0, angle = 0;
};

Point measure(const Space& space, const std::vector<Pixels>& windows, int quality,
              const RunContext& context) {
  JpegKind kind = space.kind;
  kind.quality = quality;
  Point out;
  const std::array qualities{quality};
  std::vector<std::vector<Pixels>> coded(space.two ? 2 : 1);
  for (std::size_t c = 0; c < coded.size(); ++c) {
    for (const PixelWindow& w : views_of(windows)) {
      const Pixels& plain = windows[coded[c].size()];
      const Pixels made = space.without_z ? without_z(w) : plain;
      coded[c].push_back(space.two ? channel_of(made, c) : made);
    }
    const std::vector<PixelWindow> views = views_of(coded[c]);
    out.bits += jpeg_bits(kind, views, qualities, context)[0];
    JpegCoder coder(kind);
    for (std::size_t w = 0; w < views.size(); ++w)
      coded[c][w] = decode_jpeg(coder.complete(views[w]), std::uint64_t{kWindowPx} * kWindowPx);
  }
  double texels = 0;
  for (std::size_t w = 0; w < windows.size(); ++w)
    for (std::size_t i = 0; i < windows[w].data.size(); i += 3, ++texels) {
      const std::array<double, 3> is = vector_of(&windows[w].data[i]);
      Pixels shown{1, 1, 3, {}};
      for (std::size_t c = 0; c < 3; ++c)
        shown.data.push_back(!space.two ? coded[0][w].data[i + c] : c < 2 ? coded[c][w].data[i / 3] : 128);
      if (space.without_z) rebuild_z(shown);
      out.angle += angle(is, vector_of(shown.data.data()));
    }
  out.angle /= texels;
  return out;
}

using Curve = std::array<Point, kQualities.size()>;

/// At an angle within the curve's.
double log_bits_at(const Curve& curve, double angle) {
  for (std::size_t k = 1; k < curve.size(); ++k) {
    if (curve[k].angle > angle && k + 1 < curve.size()) continue;
    const double from = std::log(curve[k - 1].angle), to = std::log(curve[k].angle);
    const double part = from > to ? (from - std::log(angle)) / (from - to) : 1;
    return std::log(curve[k - 1].bits) + part * (std::log(curve[k].bits) - std::log(curve[k - 1].bits));
  }
  return std::log(curve.back().bits);
}

/// The one's bits over the other's at equal angles, geometric mean over the angles that both have.
double ratio_of(const Curve& one, const Curve& other) {
  constexpr int kAngles = 9;
  const double most = std::log(std::min(one.front().angle, other.front().angle)),
               least = std::log(std::max(one.back().angle, other.back().angle));
  double sum = 0;
  for (int k = 0; k < kAngles; ++k) {
    const double at = std::exp(least + (most - least) * k / (kAngles - 1));
    sum += log_bits_at(one, at) - log_bits_at(other, at);
  }
  return std::exp(sum / kAngles);
}

std::string chosen(const std::vector<Pixels>& windows, const RunContext& context) {
  const CodingSpace space = measure_coding_space(DataKind::kVectors, false, views_of(windows), context);
  const char* ycc = space.subsampling == Subsampling::k420 ? "YCbCr 4:2:0" : "YCbCr 4:4:4";
  return !space.apart ? ycc : space.without_z ? "no z" : space.coarse_last ? "coarse z" : "channels apart";
}

void print_image(const std::string& path, const RunContext& context) {
  std::ifstream in(path, std::ios::binary);
  const Pixels image = decode_image(probe_image(path, Bytes{std::istreambuf_iterator<char>(in), {}}, {}));
  if (image.channels < 3) return void(std::cout << path << ": no three channels\n");
  const std::vector<Pixels> windows = windows_of(image);
  if (windows.empty()) return void(std::cout << path << ": smaller than a window\n");
  std::cout << fmt::format("{}, {} x {} px, {} windows; kB / degrees\n{:16}", path, image.width_px,
                           image.height_px, windows.size(), "");
  for (const int q : kQualities) std::cout << fmt::format("{:>14}", fmt::format("q{}", q));
  std::cout << "   over apart  over coarse z\n";
  std::vector<Curve> curves;
  for (const Space& space : spaces()) {
    Curve curve{};
    std::cout << fmt::format("{:16}", space.name);
    for (std::size_t q = 0; q < curve.size(); ++q) {
      curve[q] = measure(space, windows, kQualities[q], context);
      std::cout << fmt::format("{:>14}",
                               fmt::format("{:.1f} / {:.2f}", curve[q].bits / 8000, curve[q].angle));
    }
    curves.push_back(curve);
    std::cout << fmt::format("   {:.3f}", ratio_of(curve, curves[0]));
    std::cout << (curves.size() > 1 ? fmt::format("       {:.3f}\n", ratio_of(curve, curves[1])) : "\n");
  }
  std::cout << "the compiler takes " << chosen(windows, context) << "\n\n";
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) try {
      texmesh::print_image(argv[i], texmesh::RunContext{});
    } catch (const std::exception& e) {
      std::cerr << argv[i] << ": " << e.what() << '\n';
      return 1;
    }
}
