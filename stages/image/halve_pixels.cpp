#include "stages/image/halve_pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <type_traits>
#include <vector>

#include "format/base/errors.h"
#include "format/base/srgb.h"
#include "format/base/vec.h"
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

/// What an output texel takes along one axis: `count` texels from `first` on.
struct Taps {
  static constexpr std::uint32_t kMost = 9;  // an eighth of 8 k + 1 texels takes parts of nine
  std::uint32_t first = 0, count = 0;
  std::array<std::uint64_t, kMost> weight{};
};

/// One axis of a reduction to 1 / divisor, rounded up.
struct Axis {
  std::vector<Taps> taps;
  std::uint64_t whole = 0;  // sum of the weights of each output
  bool even = false;        // all weights are 1
};

Axis axis_of(std::uint32_t size, std::uint32_t divisor) {
  const std::uint32_t less = (size + divisor - 1) / divisor, common = std::gcd(size, less);
  const std::uint64_t w = size / common, o = less / common;
  Axis axis{std::vector<Taps>(less), w, o == 1};
  for (std::uint32_t i = 0; i < less; ++i) {
    const std::uint64_t lo = i * w, hi = (i + std::uint64_t{1}) * w;  // in units of 1 / o texels
    Taps& taps = axis.taps[i];
    taps.first = static_cast<std::uint32_t>(lo / o);
    for (std::uint64_t j = lo / o; j * o < hi; ++j)
      taps.weight[taps.count++] = std::min(hi, (j + 1) * o) - std::max(lo, j * o);
  }
  return axis;
}

void put_normal(const std::array<std::uint64_t, 3>& sum, std::uint64_t whole, std::uint8_t* to) {
  double n[3], squared = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    n[c] = static_cast<double>(sum[c]) / (127.5 * static_cast<double>(whole)) - 1;
    squared += n[c] * n[c];
  }
  const double length = squared > 1e-4 ? std::sqrt(squared) : 1;
  for (std::size_t c = 0; c < 3; ++c)
    to[c] = static_cast<std::uint8_t>(std::clamp(std::floor((n[c] / length + 1) * 127.5 + 0.5), 0.0, 255.0));
}

/// Rows first .. last - 1 of the output. kWhole: all weights are 1 (sides are multiples of the divisor),
/// which takes half the time.
template <Halving kKind, std::uint32_t C, bool kWhole>
void reduce_rows(const Pixels& from, const Axis& columns, const Axis& rows, std::size_t first,
                 std::size_t last, Pixels& to) {
  const LightTables& light = light_tables();
  using Sum = std::conditional_t<kWhole, std::uint32_t, std::uint64_t>;  // of at most 64 texels of 16 bits
  const std::uint64_t whole = columns.whole * rows.whole;
  std::uint8_t* out = to.data.data() + first * to.width_px * C;
  for (std::size_t y = first; y < last; ++y)
    for (const Taps& column : columns.taps) {
      const Taps& row = rows.taps[y];
      std::array<Sum, 3> sum{};
      for (std::uint32_t v = 0; v < row.count; ++v) {
        const std::uint8_t* p = from.at(column.first, row.first + v);
        for (std::uint32_t u = 0; u < column.count; ++u, p += C) {
          const Sum weight = kWhole ? 1 : static_cast<Sum>(row.weight[v] * column.weight[u]);
#pragma GCC unroll 3  // sums in registers: a third of the time
          for (std::uint32_t c = 0; c < C; ++c)
            sum[c] += weight * (kKind == Halving::kLight ? light.linear[p[c]] : p[c]);
        }
      }
      if constexpr (kKind == Halving::kNormals) {
        put_normal({sum[0], sum[1], sum[2]}, whole, out);
      } else {
        for (std::uint32_t c = 0; c < C; ++c) {
          const std::uint64_t mean = (sum[c] + whole / 2) / whole;
          out[c] = kKind == Halving::kLight ? light.encoded[mean] : static_cast<std::uint8_t>(mean);
        }
      }
      out += C;
    }
}

template <Halving kKind, std::uint32_t C>
void reduce(const Pixels& from, const Axis& columns, const Axis& rows, std::size_t first, std::size_t last,
            Pixels& to) {
  if (columns.even && rows.even)
    reduce_rows<kKind, C, true>(from, columns, rows, first, last, to);
  else
    reduce_rows<kKind, C, false>(from, columns, rows, first, last, to);
}

void check(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, Halving kind) {
  const bool grey = from.channels == 1;
  if (width_px == 0 || height_px == 0 || width_px > from.width_px || height_px > from.height_px ||
      from.data.size() != std::size_t{from.width_px} * from.height_px * from.channels ||
      (!grey && from.channels != 3) || (grey && kind == Halving::kNormals))
    throw StageError("fragmentation", "pixels to halve", "1 or 3 channels of the size that is asked for",
                     std::to_string(from.width_px) + " x " + std::to_string(from.height_px) + " x " +
                         std::to_string(from.channels));
}

Pixels reduced(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, std::uint32_t divisor,
               Halving kind, const RunContext& context) {
  check(from, width_px, height_px, kind);
  const Axis columns = axis_of(width_px, divisor), rows = axis_of(height_px, divisor);
  Pixels to{static_cast<std::uint32_t>(columns.taps.size()),
            static_cast<std::uint32_t>(rows.taps.size()),
            from.channels,
            {}};
  to.data.resize(std::size_t{to.width_px} * to.height_px * to.channels);
  const bool grey = from.channels == 1;
  constexpr std::size_t kRowsPerTask = 8;
  parallel_for(context, to.height_px, kRowsPerTask, [&](std::size_t first, std::size_t last) {
    if (kind == Halving::kNormals)
      reduce<Halving::kNormals, 3>(from, columns, rows, first, last, to);
    else if (kind == Halving::kLight)
      grey ? reduce<Halving::kLight, 1>(from, columns, rows, first, last, to)
           : reduce<Halving::kLight, 3>(from, columns, rows, first, last, to);
    else
      grey ? reduce<Halving::kNumbers, 1>(from, columns, rows, first, last, to)
           : reduce<Halving::kNumbers, 3>(from, columns, rows, first, last, to);
  });
  return to;
}

}  // namespace

Halving halving_of(TextureRole role, std::uint32_t channels) {
  if (is_colour(role)) return Halving::kLight;
  return role == TextureRole::kNormal && channels == 3 ? Halving::kNormals : Halving::kNumbers;
}

Pixels halved(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, Halving kind) {
  return reduced(from, width_px, height_px, 2, kind, {});
}

Pixels eighth_of(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, Halving kind,
                 const RunContext& context) {
  return reduced(from, width_px, height_px, 8, kind, context);
}

}  // namespace texmesh
