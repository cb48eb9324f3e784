#include "stages/render/render_texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "format/base/portable_math.h"
#include "format/base/srgb.h"
#include "stages/base/parallel.h"
#include "stages/render/render_math.h"

namespace texmesh {
namespace {

using ByteCurve = std::array<float, 256>;

const ByteCurve& numbers_of_bytes() {
  static const ByteCurve table = [] {
    ByteCurve t{};
    for (std::size_t i = 0; i < t.size(); ++i) t[i] = static_cast<float>(i) / 255;
    return t;
  }();
  return table;
}

/// A coordinate in texels before the middle of the first one, and how many there are.
struct Axis {
  std::int32_t first = 0, second = 0;  // texels
  float part = 0;                      // of the way from first to second
};

/// 0..1 inside the image, with mirrors and repetitions folded back.
float folded(float u, Wrap wrap) {
  constexpr float kMost = 1e6f;
  if (!(u >= -kMost && u <= kMost)) return 0;
  if (wrap == Wrap::kClamp) return render::saturated(u);
  if (wrap == Wrap::kRepeat) return u - static_cast<float>(render::floor_of(u));
  const float t = u - 2 * static_cast<float>(render::floor_of(u * 0.5f));
  return t > 1 ? 2 - t : t;
}

/// `u` is folded.
Axis bilinear_axis(float u, std::uint32_t size, Wrap wrap) {
  const auto n = static_cast<std::int32_t>(size);
  const float at = u * static_cast<float>(n) - 0.5f;
  Axis axis;
  axis.first = render::floor_of(at);
  axis.second = axis.first + 1;
  axis.part = at - static_cast<float>(axis.first);
  if (wrap == Wrap::kRepeat) {
    if (axis.first < 0) axis.first += n;
    if (axis.second >= n) axis.second -= n;
  }
  // A mirrored image meets its own last texel at the border, just as a clamped one.
  axis.first = std::clamp(axis.first, 0, n - 1);
  axis.second = std::clamp(axis.second, 0, n - 1);
  return axis;
}

/// `u` is folded.
std::int32_t nearest_texel(float u, std::uint32_t size) {
  const auto n = static_cast<std::int32_t>(size);
  return std::clamp(render::floor_of(u * static_cast<float>(n)), 0, n - 1);
}

template <std::size_t N>
Vec4f rgba(const float* v) {
  if constexpr (N == 1) return {v[0], v[0], v[0], 1};
  if constexpr (N == 2) return {v[0], v[0], v[0], v[1]};
  if constexpr (N == 3) return {v[0], v[1], v[2], 1};
  return {v[0], v[1], v[2], v[3]};
}

template <std::size_t N>
Vec4f bilinear(const Pixels& level, const ByteCurve& colour, const Axis& x, const Axis& y) {
  const ByteCurve& number = numbers_of_bytes();
  auto texel = [&](std::int32_t column, std::int32_t row) {
    return level.data.data() +
           (static_cast<std::size_t>(row) * level.width_px + static_cast<std::size_t>(column)) * N;
  };
  const std::uint8_t *a = texel(x.first, y.first), *b = texel(x.second, y.first),
                     *c = texel(x.first, y.second), *d = texel(x.second, y.second);
  const float wd = x.part * y.part, wb = x.part - wd, wc = y.part - wd, wa = 1 - x.part - wc;
  float value[N];
  for (std::size_t k = 0; k < N; ++k) {
    const ByteCurve& curve = (N == 2 || N == 4) && k + 1 == N ? number : colour;
    value[k] = (curve[a[k]] * wa + curve[b[k]] * wb) + (curve[c[k]] * wc + curve[d[k]] * wd);
  }
  return rgba<N>(value);
}

Vec4f read_bilinear(const Pixels& level, bool srgb, const TextureSlot& slot, Vec2f uv) {
  const Axis x = bilinear_axis(uv.x, level.width_px, slot.wrap_s),
             y = bilinear_axis(uv.y, level.height_px, slot.wrap_t);
  const ByteCurve& colour = srgb ? light_of_bytes() : numbers_of_bytes();
  switch (level.channels) {
    case 1:
      return bilinear<1>(level, colour, x, y);
    case 2:
      return bilinear<2>(level, colour, x, y);
    case 3:
      return bilinear<3>(level, colour, x, y);
    default:
      return bilinear<4>(level, colour, x, y);
  }
}

Vec4f read_nearest(const Pixels& level, bool srgb, Vec2f uv) {
  const std::int32_t x = nearest_texel(uv.x, level.width_px), y = nearest_texel(uv.y, level.height_px);
  const ByteCurve& colour = srgb ? light_of_bytes() : numbers_of_bytes();
  const Axis ax{x, x, 0}, ay{y, y, 0};
  switch (level.channels) {
    case 1:
      return bilinear<1>(level, colour, ax, ay);
    case 2:
      return bilinear<2>(level, colour, ax, ay);
    case 3:
      return bilinear<3>(level, colour, ax, ay);
    default:
      return bilinear<4>(level, colour, ax, ay);
  }
}

float level_of(const RenderTexture& texture, const TextureFootprint& footprint) {
  const auto w = static_cast<float>(texture.width_px), h = static_cast<float>(texture.height_px);
  const Vec2f dx{footprint.uv_dx.x * w, footprint.uv_dx.y * h},
      dy{footprint.uv_dy.x * w, footprint.uv_dy.y * h};
  const float longer = std::max(dot(dx, dx), dot(dy, dy));
  // Not finite: the derivatives of a triangle seen edge-on. The smallest level shows its mean.
  if (!(longer < 1e30f)) return 100;
  return longer > 1e-30f ? 0.5f * render::log2_of(longer) : -100;
}

}  // namespace

Vec4f read_texture(const RenderTexture& texture, const TextureSlot& slot, const TextureFootprint& footprint) {
  const float level = level_of(texture, footprint);
  const Pixels& finest = texture.levels.front();
  const Vec2f uv{folded(footprint.uv.x, slot.wrap_s), folded(footprint.uv.y, slot.wrap_t)};
  if (level <= 0 ? slot.mag_filter == MagFilter::kNearest : slot.min_filter == MinFilter::kNearest)
    return read_nearest(finest, texture.srgb, uv);
  const auto first = static_cast<float>(texture.first_level);
  if (level <= first || slot.min_filter != MinFilter::kTrilinear)
    return read_bilinear(finest, texture.srgb, slot, uv);
  const float at = std::min(level - first, static_cast<float>(texture.levels.size() - 1));
  const auto fine = static_cast<std::size_t>(at);
  const float part = at - static_cast<float>(fine);
  const Vec4f a = read_bilinear(texture.levels[fine], texture.srgb, slot, uv);
  if (part == 0) return a;
  const Vec4f b = read_bilinear(texture.levels[fine + 1], texture.srgb, slot, uv);
  return {a.x + (b.x - a.x) * part, a.y + (b.y - a.y) * part, a.z + (b.z - a.z) * part,
          a.w + (b.w - a.w) * part};
}

UvMatrix uv_matrix(const UvTransform& t) {
  if (t.is_identity()) return {};
  const auto c = static_cast<float>(portable::cos(t.rotation)),
             s = static_cast<float>(portable::sin(t.rotation));
  return {c * t.scale.x, s * t.scale.y, t.offset.x, -s * t.scale.x, c * t.scale.y, t.offset.y};
}

}  // namespace texmesh
