#include "stages/image/resize.h"

#include <cmath>
#include <numeric>
#include <type_traits>

#include "stages/base/float_math.h"
#include "stages/base/parallel.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kFull = 65535;  // linear light in 16 bits

struct LightTables {
  std::array<std::uint16_t, 256> linear{};
  std::vector<std::uint8_t> encoded;  // [kFull + 1]
};

const LightTables& light_tables() {
  static const LightTables tables = [] {
    LightTables t;
    t.encoded.resize(kFull + 1);
    for (std::size_t v = 0; v < 256; ++v)
      t.linear[v] =
          static_cast<std::uint16_t>(std::floor(light_of_srgb(static_cast<double>(v) / 255) * kFull + 0.5));
    std::size_t at = 0;
    for (std::size_t v = 0; v < 256; ++v) {  // v up to where v + 1 is nearer in encoded values
      const double end = v == 255 ? kFull + 1.0 : light_of_srgb((static_cast<double>(v) + 0.5) / 255) * kFull;
      for (; at <= kFull && static_cast<double>(at) < end; ++at) t.encoded[at] = static_cast<std::uint8_t>(v);
    }
    return t;
  }();
  return tables;
}

/// What an output texel takes along one axis: `count` texels from `first` on, whose weights begin at `at`.
struct Taps {
  std::uint32_t first = 0, count = 0;
  std::size_t at = 0;
};

/// One axis of a reduction.
struct Axis {
  std::vector<Taps> taps;
  std::vector<std::uint64_t> weights;  // of the end texels the parts that count; `unit` of all others
  std::uint64_t unit = 1;
  std::uint64_t whole = 0;  // sum of the weights of each output
  bool even() const { return unit == 1; }
};

Axis axis_of(std::uint32_t size, std::uint32_t less) {
  const std::uint32_t common = std::gcd(size, less);
  const std::uint64_t w = size / common, o = less / common;
  Axis axis{std::vector<Taps>(less), {}, o, w};
  for (std::uint32_t i = 0; i < less; ++i) {
    const std::uint64_t lo = i * w, hi = (i + std::uint64_t{1}) * w;  // in units of 1 / o texels
    Taps& taps = axis.taps[i];
    taps.first = static_cast<std::uint32_t>(lo / o);
    taps.at = axis.weights.size();
    for (std::uint64_t j = lo / o; j * o < hi; ++j, ++taps.count)
      axis.weights.push_back(std::min(hi, (j + 1) * o) - std::max(lo, j * o));
  }
  return axis;
}

void put_normal(std::array<double, 3> n, std::uint8_t* to) {
  const double squared = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
  const double length = squared > 1e-4 ? std::sqrt(squared) : 1;
  for (std::size_t c = 0; c < 3; ++c)
    to[c] = static_cast<std::uint8_t>(std::clamp(std::floor((n[c] / length + 1) * 127.5 + 0.5), 0.0, 255.0));
}

/// Rows first .. last - 1 of the output. kWhole: all weights are 1 (sides are multiples of the divisor),
/// which takes half the time.
template <Averaging kKind, std::uint32_t C, bool kWhole>
void reduce_rows(const Pixels& from, const Axis& columns, const Axis& rows, std::size_t first,
                 std::size_t last, Pixels& to) {
  const LightTables& light = light_tables();
  using Sum = std::conditional_t<kWhole, std::uint32_t, std::uint64_t>;  // of at most 64 texels of 16 bits
  const std::uint64_t whole = columns.whole * rows.whole;
  std::uint8_t* out = to.data.data() + first * to.width_px * C;
  for (std::size_t y = first; y < last; ++y)
    for (const Taps& column : columns.taps) {
      const Taps& row = rows.taps[y];
      const std::uint64_t *row_weight = &rows.weights[row.at], *column_weight = &columns.weights[column.at];
      std::array<Sum, 3> sum{};
      for (std::uint32_t v = 0; v < row.count; ++v) {
        const std::uint8_t* p = from.at(column.first, row.first + v);
        for (std::uint32_t u = 0; u < column.count; ++u, p += C) {
          const Sum weight = kWhole ? 1 : static_cast<Sum>(row_weight[v] * column_weight[u]);
#pragma GCC unroll 3  // sums in registers: a third of the time
          for (std::uint32_t c = 0; c < C; ++c)
            sum[c] += weight * (kKind == Averaging::kLight ? light.linear[p[c]] : p[c]);
        }
      }
      if constexpr (kKind == Averaging::kNormals) {
        const double unit = 127.5 * static_cast<double>(whole);
        put_normal({static_cast<double>(sum[0]) / unit - 1, static_cast<double>(sum[1]) / unit - 1,
                    static_cast<double>(sum[2]) / unit - 1},
                   out);
      } else {
        for (std::uint32_t c = 0; c < C; ++c) {
          const std::uint64_t mean = (sum[c] + whole / 2) / whole;
          out[c] = kKind == Averaging::kLight ? light.encoded[mean] : static_cast<std::uint8_t>(mean);
        }
      }
      out += C;
    }
}

template <Averaging kKind, std::uint32_t C>
void reduce(const Pixels& from, const Axis& columns, const Axis& rows, std::size_t first, std::size_t last,
            Pixels& to) {
  if (columns.even() && rows.even())
    reduce_rows<kKind, C, true>(from, columns, rows, first, last, to);
  else
    reduce_rows<kKind, C, false>(from, columns, rows, first, last, to);
}

void check(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, Averaging kind) {
  const bool grey = from.channels == 1;
  if (width_px == 0 || height_px == 0 || width_px > from.width_px || height_px > from.height_px ||
      from.data.size() != std::size_t{from.width_px} * from.height_px * from.channels ||
      (!grey && from.channels != 3) || (grey && kind == Averaging::kNormals))
    throw StageError("fragmentation", "pixels to halve", "1 or 3 channels of the size that is asked for",
                     std::to_string(from.width_px) + " x " + std::to_string(from.height_px) + " x " +
                         std::to_string(from.channels));
}

Pixels part_of(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, std::uint32_t divisor,
               Averaging kind, const RunContext& context) {
  check(from, width_px, height_px, kind);
  const Axis columns = axis_of(width_px, (width_px + divisor - 1) / divisor),
             rows = axis_of(height_px, (height_px + divisor - 1) / divisor);
  Pixels to{static_cast<std::uint32_t>(columns.taps.size()),
            static_cast<std::uint32_t>(rows.taps.size()),
            from.channels,
            {}};
  to.data.resize(std::size_t{to.width_px} * to.height_px * to.channels);
  const bool grey = from.channels == 1;
  constexpr std::size_t kRowsPerTask = 8;
  parallel_for(context, to.height_px, kRowsPerTask, [&](std::size_t first, std::size_t last) {
    if (kind == Averaging::kNormals)
      reduce<Averaging::kNormals, 3>(from, columns, rows, first, last, to);
    else if (kind == Averaging::kLight)
      grey ? reduce<Averaging::kLight, 1>(from, columns, rows, first, last, to)
           : reduce<Averaging::kLight, 3>(from, columns, rows, first, last, to);
    else
      grey ? reduce<Averaging::kNumbers, 1>(from, columns, rows, first, last, to)
           : reduce<Averaging::kNumbers, 3>(from, columns, rows, first, last, to);
  });
  return to;
}

/// The weights as parts of a texel.
std::vector<float> shares_of(const Axis& axis) {
  std::vector<float> out;
  for (const std::uint64_t weight : axis.weights)
    out.push_back(static_cast<float>(static_cast<double>(weight) / static_cast<double>(axis.unit)));
  return out;
}

/// Adds one input row, averaged along x, to the sums of an output row.
void add_row(const std::uint8_t* row, std::uint32_t channels, const std::array<float, 256>& value,
             const Axis& columns, const std::vector<float>& shares, float weight, std::vector<float>& sums) {
  float* to = sums.data();
  for (const Taps& s : columns.taps) {
    const float* share = &shares[s.at];
    for (std::uint32_t c = 0; c < channels; ++c) {
      const std::uint8_t* at = row + std::size_t{s.first} * channels + c;
      float sum = value[*at] * share[0];
      for (std::uint32_t k = 1; k < s.count; ++k) sum += value[at[std::size_t{k} * channels]] * share[k];
      *to++ += sum * weight;
    }
  }
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

Averaging averaging_of(TextureRole role, std::uint32_t channels) {
  if (is_colour(role)) return Averaging::kLight;
  return role == TextureRole::kNormal && channels == 3 ? Averaging::kNormals : Averaging::kNumbers;
}

Pixels halved(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, Averaging kind) {
  return part_of(from, width_px, height_px, 2, kind, {});
}

Pixels eighth_of(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, Averaging kind,
                 const RunContext& context) {
  return part_of(from, width_px, height_px, 8, kind, context);
}

Pixels reduced(const Pixels& from, std::uint32_t used_width, std::uint32_t used_height, std::uint32_t width,
               std::uint32_t height, Averaging kind, float sharpening) {
  if (width == 0 || height == 0 || width > used_width || height > used_height || used_width > from.width_px ||
      used_height > from.height_px)
    throw StageError("resize", "size",
                     "1 x 1 to " + std::to_string(used_width) + " x " + std::to_string(used_height),
                     std::to_string(width) + " x " + std::to_string(height));
  if (width == used_width && height == used_height) return cropped(from, width, height);
  std::array<float, 256> value;
  std::iota(value.begin(), value.end(), 0.f);
  if (kind == Averaging::kLight) value = light_of_bytes();
  const Axis columns = axis_of(used_width, width), rows = axis_of(used_height, height);
  const std::vector<float> column_shares = shares_of(columns), row_shares = shares_of(rows);
  const float scale = static_cast<float>(static_cast<double>(width) * height /
                                         (static_cast<double>(used_width) * used_height));
  const std::size_t stride = std::size_t{width} * from.channels;
  std::vector<float> means(stride * height), sums;
  for (std::uint32_t y = 0; y < height; ++y) {
    sums.assign(stride, 0);
    const Taps& row = rows.taps[y];
    for (std::uint32_t k = 0; k < row.count; ++k)
      add_row(from.at(0, row.first + k), from.channels, value, columns, column_shares, row_shares[row.at + k],
              sums);
    for (std::size_t i = 0; i < stride; ++i) means[y * stride + i] = sums[i] * scale;
  }
  if (sharpening > 0 && kind != Averaging::kNormals) {
    for (std::uint32_t y = 0; y < height; ++y)
      sharpen(means.data() + y * stride, width, from.channels, from.channels, sharpening);
    for (std::uint32_t x = 0; x < width; ++x)
      sharpen(means.data() + std::size_t{x} * from.channels, height, stride, from.channels, sharpening);
  }
  static const SrgbEncoder<float, true> encode;
  Pixels out{width, height, from.channels, {}};
  out.data.resize(means.size());
  if (kind == Averaging::kNormals && from.channels == 3)
    for (std::size_t i = 0; i < means.size(); i += 3) {
      const auto signed_mean = [&](std::size_t c) { return static_cast<double>(means[i + c]) / 127.5 - 1; };
      put_normal({signed_mean(0), signed_mean(1), signed_mean(2)}, out.data.data() + i);
    }
  else
    for (std::size_t i = 0; i < means.size(); ++i)
      out.data[i] = kind == Averaging::kLight
                        ? encode(means[i])
                        : static_cast<std::uint8_t>(std::clamp(std::floor(means[i] + 0.5f), 0.f, 255.f));
  return out;
}

Pixels joined_alpha(const Pixels& colours, const Pixels& alpha) {
  Pixels out{colours.width_px, colours.height_px, 4, {}};
  out.data.reserve(std::size_t{4} * colours.width_px * colours.height_px);
  const auto place = [](std::uint32_t at, std::uint32_t of, std::uint32_t to) {
    return of == to ? at : static_cast<std::uint32_t>(std::uint64_t{at} * to / of);
  };
  for (std::uint32_t y = 0; y < colours.height_px; ++y)
    for (std::uint32_t x = 0; x < colours.width_px; ++x) {
      const std::uint8_t* c = colours.at(x, y);
      for (std::uint32_t k = 0; k < 3; ++k) out.data.push_back(c[colours.channels == 1 ? 0 : k]);
      out.data.push_back(*alpha.at(place(x, colours.width_px, alpha.width_px),
                                   place(y, colours.height_px, alpha.height_px)));
    }
  return out;
}

Pixels reduced_with_alpha(const Pixels& from, std::uint32_t width, std::uint32_t height, Averaging kind) {
  const auto to_size = [&](const Pixels& p, Averaging how) {
    return reduced(p, p.width_px, p.height_px, width, height, how);
  };
  if (from.channels % 2 == 1) return to_size(from, kind);
  Pixels colours{from.width_px, from.height_px, 3, {}}, alpha{from.width_px, from.height_px, 1, {}};
  colours.data.reserve(3 * from.data.size() / from.channels);
  for (std::size_t i = 0; i < from.data.size(); i += from.channels) {
    for (std::size_t k = 0; k < 3; ++k) colours.data.push_back(from.data[i + (from.channels == 4 ? k : 0)]);
    alpha.data.push_back(from.data[i + from.channels - 1]);
  }
  return joined_alpha(to_size(colours, kind), to_size(alpha, Averaging::kNumbers));
}

}  // namespace texmesh
