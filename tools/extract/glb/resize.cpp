#include "tools/extract/glb/resize.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "format/base/errors.h"
#include "format/base/srgb.h"
#include "format/base/vec.h"

namespace texmesh {
namespace {

constexpr int kCodeSteps = 4096;

/// sRGB <-> linear light.
struct LightCurves {
  std::array<float, 256> linear{};
  std::array<float, 256> upto{};                     // linear light up to which a code is the nearest one
  std::array<std::uint8_t, kCodeSteps + 1> first{};  // code to start looking at, by linear light
};

const LightCurves& light_curves() {
  static const LightCurves curves = [] {
    LightCurves c;
    for (std::size_t v = 0; v < 256; ++v) {
      c.linear[v] = static_cast<float>(light_of_srgb(static_cast<double>(v) / 255));
      c.upto[v] = v == 255 ? 2.f : static_cast<float>(light_of_srgb((static_cast<double>(v) + 0.5) / 255));
    }
    std::uint8_t code = 0;
    for (std::size_t i = 0; i <= kCodeSteps; ++i) {
      while (static_cast<float>(i) / kCodeSteps > c.upto[code]) ++code;
      c.first[i] = code;
    }
    return c;
  }();
  return curves;
}

std::uint8_t code_of_light(float light) {
  const LightCurves& c = light_curves();
  const float at = std::clamp(light, 0.f, 1.f);
  std::uint8_t code = c.first[static_cast<std::size_t>(at * kCodeSteps)];
  while (at > c.upto[code]) ++code;
  return code;
}

/// What output texel i takes of the input along one axis.
struct Span {
  std::uint32_t first = 0, count = 0;
  float first_share = 1, last_share = 1;  // of the end texels, the others count wholly
};

std::vector<Span> spans_of(std::uint32_t from, std::uint32_t to) {
  std::vector<Span> out(to);
  for (std::uint64_t i = 0; i < to; ++i) {
    const std::uint64_t lo = i * from, hi = (i + 1) * from;  // in units of 1 / to texels
    Span& s = out[static_cast<std::size_t>(i)];
    s.first = static_cast<std::uint32_t>(lo / to);
    const std::uint64_t last = (hi - 1) / to;
    s.count = static_cast<std::uint32_t>(last - s.first + 1);
    s.first_share = static_cast<float>(static_cast<double>((s.first + std::uint64_t{1}) * to - lo) / to);
    s.last_share = static_cast<float>(static_cast<double>(hi - last * to) / to);
    if (s.count == 1) s.first_share = s.last_share = static_cast<float>(static_cast<double>(hi - lo) / to);
  }
  return out;
}

float share(const Span& s, std::uint32_t k) {
  return k == 0 ? s.first_share : k + 1 == s.count ? s.last_share : 1.f;
}

/// Adds one input row, averaged along x, to the sums of an output row.
void add_row(const std::uint8_t* row, std::uint32_t channels, const std::array<float, 256>& value,
             const std::vector<Span>& columns, float weight, std::vector<float>& sums) {
  float* to = sums.data();
  for (const Span& s : columns) {
    for (std::uint32_t c = 0; c < channels; ++c) {
      const std::uint8_t* at = row + std::size_t{s.first} * channels + c;
      float sum = value[*at] * s.first_share;
      for (std::uint32_t k = 1; k < s.count; ++k) sum += value[at[std::size_t{k} * channels]] * share(s, k);
      *to++ += sum * weight;
    }
  }
}

void put_normal(const float* mean, std::uint8_t* to) {
  double n[3], squared = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    n[c] = static_cast<double>(mean[c]) / 127.5 - 1;
    squared += n[c] * n[c];
  }
  // Vectors that cancel out stay what they are.
  const double length = squared > 1e-4 ? std::sqrt(squared) : 1;
  for (std::size_t c = 0; c < 3; ++c)
    to[c] = static_cast<std::uint8_t>(std::clamp(std::floor((n[c] / length + 1) * 127.5 + 0.5), 0.0, 255.0));
}

/// (-s, 1 + 2 s, -s) along a line of `count` texels `step` apart, end texels repeated.
void sharpen(float* line, std::uint32_t count, std::size_t step, std::uint32_t channels, float s) {
  for (std::uint32_t c = 0; c < channels; ++c) {
    float before = line[c], here = line[c];
    for (std::uint32_t i = 0; i < count; ++i) {
      const float after = i + 1 < count ? line[(i + std::size_t{1}) * step + c] : here;
      line[i * step + c] = here + s * (2 * here - before - after);
      before = here;
      here = after;
    }
  }
}

Pixels cropped(const Pixels& from, std::uint32_t width, std::uint32_t height) {
  Pixels out{width, height, from.channels, {}};
  out.data.reserve(std::size_t{width} * height * from.channels);
  for (std::uint32_t y = 0; y < height; ++y)
    out.data.insert(out.data.end(), from.at(0, y), from.at(0, y) + std::size_t{width} * from.channels);
  return out;
}

}  // namespace

Pixels reduced(const Pixels& from, std::uint32_t used_width, std::uint32_t used_height, std::uint32_t width,
               std::uint32_t height, Averaging kind, float sharpening) {
  if (width == 0 || height == 0 || width > used_width || height > used_height || used_width > from.width_px ||
      used_height > from.height_px)
    throw StageError("extract", "size",
                     "1 x 1 to " + std::to_string(used_width) + " x " + std::to_string(used_height),
                     std::to_string(width) + " x " + std::to_string(height));
  if (width == used_width && height == used_height) return cropped(from, width, height);
  std::array<float, 256> numbers;
  for (std::size_t v = 0; v < 256; ++v) numbers[v] = static_cast<float>(v);
  const std::array<float, 256>& value = kind == Averaging::kLight ? light_curves().linear : numbers;
  const std::vector<Span> columns = spans_of(used_width, width), rows = spans_of(used_height, height);
  const float scale = static_cast<float>(static_cast<double>(width) * height /
                                         (static_cast<double>(used_width) * used_height));
  const std::size_t stride = std::size_t{width} * from.channels;
  std::vector<float> means(stride * height), sums;
  for (std::uint32_t y = 0; y < height; ++y) {
    sums.assign(stride, 0);
    for (std::uint32_t k = 0; k < rows[y].count; ++k)
      add_row(from.at(0, rows[y].first + k), from.channels, value, columns, share(rows[y], k), sums);
    for (std::size_t i = 0; i < stride; ++i) means[y * stride + i] = sums[i] * scale;
  }
  if (sharpening > 0 && kind != Averaging::kNormals) {
    for (std::uint32_t y = 0; y < height; ++y)
      sharpen(means.data() + y * stride, width, from.channels, from.channels, sharpening);
    for (std::uint32_t x = 0; x < width; ++x)
      sharpen(means.data() + std::size_t{x} * from.channels, height, stride, from.channels, sharpening);
  }
  Pixels out{width, height, from.channels, {}};
  out.data.resize(means.size());
  if (kind == Averaging::kNormals && from.channels == 3)
    for (std::size_t i = 0; i < means.size(); i += 3) put_normal(means.data() + i, out.data.data() + i);
  else
    for (std::size_t i = 0; i < means.size(); ++i)
      out.data[i] = kind == Averaging::kLight
                        ? code_of_light(means[i])
                        : static_cast<std::uint8_t>(std::clamp(std::floor(means[i] + 0.5f), 0.f, 255.f));
  return out;
}

}  // namespace texmesh
