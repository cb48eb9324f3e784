#include "stages/render/visibility_tile.h"

#include <algorithm>
#include <optional>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace texmesh {
namespace {

constexpr std::uint32_t kTilePixels = kTilePx * kTilePx;
constexpr std::size_t kMostHits = std::size_t{kTilePixels} * 256;

std::uint32_t pixel_of(std::int32_t x, std::int32_t y) {
  return (static_cast<std::uint32_t>(y) / kSamplesPerSide) * kTilePx +
         static_cast<std::uint32_t>(x) / kSamplesPerSide;
}
std::uint32_t bit_of(std::int32_t x, std::int32_t y) {
  return (static_cast<std::uint32_t>(y) % kSamplesPerSide) * kSamplesPerSide +
         static_cast<std::uint32_t>(x) % kSamplesPerSide;
}

/// One triangle within a tile; samples count from the tile's corner.
class TileTriangle {
 public:
  TileTriangle(const TileInput& input, std::uint32_t triangle, std::int32_t left, std::int32_t top)
      : planes_(edge_planes(input.corners_of(triangle))),
        x_(left + 0.5 - input.frame.half),
        y_(top + 0.5 - input.frame.half) {
    const auto last = static_cast<std::int32_t>(kTileSamples) - 1;
    const SampleBox& box = input.boxes[triangle];
    box_ = {std::max(box.x_first - left, 0), std::max(box.y_first - top, 0),
            std::min(box.x_last - left, last), std::min(box.y_last - top, last)};
    nearest_ = 0, farthest_ = 1 / input.near;
    for (const Vec3d& c : input.corners_of(triangle)) {
      if (c.z < input.near) return;  // the range below holds for what is wholly in front
    }
    const std::array<Vec3d, 3> c = input.corners_of(triangle);
    nearest_ = 1 / std::max({c[0].z, c[1].z, c[2].z});
    farthest_ = 1 / std::min({c[0].z, c[1].z, c[2].z});
    clamps_ = true;
    pairs_ = input.pairs;
  }
  const EdgePlanes& planes() const { return planes_; }
  const SampleBox& box() const { return box_; }

  /// Nearness 1 / w. Rounding never takes it out of the corners' range, so that a triangle seen edge-on stays
  /// where it is. Below 0 for what is nearer than the near plane.
  double nearness(double x, double y) const {
    const double value = planes_.nearness.at(x_ + x, y_ + y);
    if (clamps_) return std::clamp(value, nearest_, farthest_);
    return value > 0 && value <= farthest_ ? value : -1;
  }

  /// Calls f(x, y, nearness) for every sample of the tile that the triangle covers.
  void for_each_sample(auto f) const {
    const auto& e = planes_.edge;
    const bool owns[3] = {owns_edge(e[0]), owns_edge(e[1]), owns_edge(e[2])};
    auto inside = [](double value, bool own) { return value > 0 || (value == 0 && own); };
    for (std::int32_t y = box_.y_first; y <= box_.y_last; ++y) {
      const double py = y_ + y;
      const double row[3] = {e[0].b * py + e[0].c, e[1].b * py + e[1].c, e[2].b * py + e[2].c};
      std::int32_t x = box_.x_first, last = box_.x_last;
      narrow(row, x, last);
#ifdef __SSE2__
      if (pairs_) {
        for_each_pair(row, y, x, last, f);
        continue;
      }
#endif
      for (; x <= last; ++x) {
        const double px = x_ + x;
        if (!inside(e[0].a * px + row[0], owns[0]) || !inside(e[1].a * px + row[1], owns[1]) ||
            !inside(e[2].a * px + row[2], owns[2]))
          continue;
        const double near = nearness(x, y);
        if (near > 0) f(x, y, near);
      }
    }
  }

  RenderFragment fragment(std::uint32_t triangle, std::uint32_t pixel, std::uint16_t mask, bool layer) const;

 private:
#ifdef __SSE2__
  /// The samples x to `last` of a row; as one after the other, of triangles wholly in front.
  void for_each_pair(const double row[3], std::int32_t y, std::int32_t x, std::int32_t last, auto f) const {
    const __m128d none = _mm_setzero_pd(), left = _mm_set1_pd(x_), two = _mm_set1_pd(2);
    __m128d slope[3], offset[3], owned[3];
    for (std::size_t k = 0; k < 3; ++k) {
      slope[k] = _mm_set1_pd(planes_.edge[k].a);
      offset[k] = _mm_set1_pd(row[k]);
      owned[k] = owns_edge(planes_.edge[k]) ? _mm_cmpeq_pd(none, none) : none;
    }
    const EdgePlane& plane = planes_.nearness;
    const __m128d near_slope = _mm_set1_pd(plane.a), near_offset = _mm_set1_pd(plane.b * (y_ + y) + plane.c),
                  low = _mm_set1_pd(nearest_), high = _mm_set1_pd(farthest_);
    for (__m128d column = _mm_set_pd(x + 1, x); x <= last; x += 2, column = _mm_add_pd(column, two)) {
      const __m128d px = _mm_add_pd(left, column);
      __m128d inside = _mm_cmpeq_pd(none, none);
      for (std::size_t k = 0; k < 3; ++k) {
        const __m128d value = _mm_add_pd(_mm_mul_pd(slope[k], px), offset[k]);
        inside = _mm_and_pd(
            inside, _mm_or_pd(_mm_cmpgt_pd(value, none), _mm_and_pd(owned[k], _mm_cmpeq_pd(value, none))));
      }
      const int covered = _mm_movemask_pd(inside) & (x == last ? 1 : 3);
      if (covered == 0) continue;
      alignas(16) double near[2];
      const __m128d value = _mm_add_pd(_mm_mul_pd(near_slope, px), near_offset);
      _mm_store_pd(near, _mm_min_pd(high, _mm_max_pd(low, value)));  // as std::clamp
      if ((covered & 1) && near[0] > 0) f(x, y, near[0]);
      if ((covered & 2) && near[1] > 0) f(x + 1, y, near[1]);
    }
  }
#endif

  /// Takes samples off both ends that are outside of an edge for certain: a row of a large triangle's box is
  /// mostly empty.
  void narrow(const double row[3], std::int32_t& first, std::int32_t& last) const {
    if (last - first < 8) return;
    for (std::size_t k = 0; k < 3; ++k) {
      const double a = planes_.edge[k].a;
      if (a == 0) continue;
      const double border = std::clamp(-row[k] / a - x_, -1e6, 1e6);
      if (a > 0)
        first = std::max(first, static_cast<std::int32_t>(border) - 1);
      else
        last = std::min(last, static_cast<std::int32_t>(border) + 1);
    }
  }

  EdgePlanes planes_;
  double x_, y_;  // of the tile's first sample in the frame
  double nearest_ = 0, farthest_ = 0;
  bool clamps_ = false, pairs_ = false;
  SampleBox box_;
};

RenderFragment TileTriangle::fragment(std::uint32_t triangle, std::uint32_t pixel, std::uint16_t mask,
                                      bool layer) const {
  const Vec2d mean = mean_of_samples(mask);
  const double x = x_ + (pixel % kTilePx) * kSamplesPerSide + mean.x,
               y = y_ + (pixel / kTilePx) * kSamplesPerSide + mean.y;
  const double weight[3] = {std::max(planes_.edge[0].at(x, y), 0.), std::max(planes_.edge[1].at(x, y), 0.),
                            std::max(planes_.edge[2].at(x, y), 0.)};
  const double sum = weight[0] + weight[1] + weight[2];
  RenderFragment out;
  out.triangle = triangle;
  out.weight1 = static_cast<float>(sum > 0 ? weight[1] / sum : 1.0 / 3);
  out.weight2 = static_cast<float>(sum > 0 ? weight[2] / sum : 1.0 / 3);
  out.mask = mask;
  out.layer = layer;
  out.back = !planes_.front;
  return out;
}

struct LayerHit {
  std::uint32_t pixel = 0, triangle = 0;
  float nearness = 0;
  std::uint16_t mask = 0;
};
bool before(const LayerHit& a, const LayerHit& b) {
  if (a.pixel != b.pixel) return a.pixel < b.pixel;
  if (a.nearness != b.nearness) return a.nearness > b.nearness;
  return a.triangle < b.triangle;
}

/// Sorts, and keeps the kMaxLayers nearest of every pixel.
void keep_nearest(std::vector<LayerHit>& hits) {
  std::sort(hits.begin(), hits.end(), before);
  std::size_t kept = 0, in_pixel = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    in_pixel = i > 0 && hits[i].pixel == hits[i - 1].pixel ? in_pixel + 1 : 0;
    if (in_pixel < kMaxLayers) hits[kept++] = hits[i];
  }
  hits.resize(kept);
}

class Tile {
 public:
  Tile(const TileInput& input, std::uint32_t tile_x, std::uint32_t tile_y)
      : input_(input),
        left_(static_cast<std::int32_t>(tile_x * kTileSamples)),
        top_(static_cast<std::int32_t>(tile_y * kTileSamples)),
        depth_(kTileSamples * kTileSamples, 0.f),
        nearest_(kTileSamples * kTileSamples, kNoIndex) {}

  void draw_opaque(std::uint32_t t) {
    const TileTriangle triangle(input_, t, left_, top_);
    if (!shows(triangle, t)) return;
    const SampleBox& box = triangle.box();
    drawn_ = {std::min(drawn_.x_first, box.x_first), std::min(drawn_.y_first, box.y_first),
              std::max(drawn_.x_last, box.x_last), std::max(drawn_.y_last, box.y_last)};
    triangle.for_each_sample([&](std::int32_t x, std::int32_t y, double nearness) {
      const std::size_t i = static_cast<std::size_t>(y) * kTileSamples + static_cast<std::size_t>(x);
      const auto d = static_cast<float>(nearness);
      if (!(d > depth_[i])) return;
      depth_[i] = d;
      nearest_[i] = t;
    });
  }

  /// Behind all opaque triangles.
  void add_layer(std::uint32_t t) {
    const TileTriangle triangle(input_, t, left_, top_);
    if (!shows(triangle, t)) return;
    masks_.assign(kTilePixels, 0);
    triangle.for_each_sample([&](std::int32_t x, std::int32_t y, double nearness) {
      const std::size_t i = static_cast<std::size_t>(y) * kTileSamples + static_cast<std::size_t>(x);
      if (static_cast<float>(nearness) < depth_[i]) return;
      masks_[pixel_of(x, y)] |= static_cast<std::uint16_t>(1u << bit_of(x, y));
    });
    const SampleBox& box = triangle.box();
    for (std::int32_t y = box.y_first / kSamplesPerSide; y <= box.y_last / kSamplesPerSide; ++y)
      for (std::int32_t x = box.x_first / kSamplesPerSide; x <= box.x_last / kSamplesPerSide; ++x) {
        const std::uint32_t pixel = static_cast<std::uint32_t>(y) * kTilePx + static_cast<std::uint32_t>(x);
        if (masks_[pixel] == 0) continue;
        const Vec2d mean = mean_of_samples(masks_[pixel]);
        hits_.push_back({pixel, t,
                         static_cast<float>(
                             triangle.nearness(x * kSamplesPerSide + mean.x, y * kSamplesPerSide + mean.y)),
                         masks_[pixel]});
      }
    if (hits_.size() > kMostHits) keep_nearest(hits_);
  }

  TileFragments finish() {
    keep_nearest(hits_);
    TileFragments out;
    out.count.assign(kTilePixels, 0);
    auto hit = hits_.begin();
    for (std::uint32_t pixel = 0; pixel < kTilePixels; ++pixel) {
      const std::size_t before_pixel = out.fragments.size();
      for (; hit != hits_.end() && hit->pixel == pixel; ++hit)
        out.fragments.push_back(fragment(hit->triangle, pixel, hit->mask, true));
      if (may_be_drawn(pixel)) add_opaque(pixel, out.fragments);
      out.count[pixel] = static_cast<std::uint32_t>(out.fragments.size() - before_pixel);
    }
    return out;
  }

 private:
  bool shows(const TileTriangle& triangle, std::uint32_t t) const {
    return triangle.planes().visible &&
           (triangle.planes().front || input_.scene->material_of(t).double_sided);
  }

  bool may_be_drawn(std::uint32_t pixel) const {
    const auto x = static_cast<std::int32_t>(pixel % kTilePx), y = static_cast<std::int32_t>(pixel / kTilePx);
    return x >= drawn_.x_first / kSamplesPerSide && x <= drawn_.x_last / kSamplesPerSide &&
           y >= drawn_.y_first / kSamplesPerSide && y <= drawn_.y_last / kSamplesPerSide;
  }

  /// Neighbouring pixels mostly show the same triangle.
  RenderFragment fragment(std::uint32_t t, std::uint32_t pixel, std::uint16_t mask, bool layer) {
    if (!shown_ || shown_index_ != t) shown_.emplace(input_, t, left_, top_);
    shown_index_ = t;
    return shown_->fragment(t, pixel, mask, layer);
  }

  /// The triangle that all samples of a pixel show, if one does.
  std::uint32_t whole_pixel(std::size_t corner) const {
    const std::uint32_t t = nearest_[corner];
    std::uint32_t other = 0;
    for (std::size_t row = 0; row < kSamplesPerSide; ++row)
      for (std::size_t column = 0; column < kSamplesPerSide; ++column)
        other |= nearest_[corner + row * kTileSamples + column] ^ t;
    return other == 0 ? t : kNoIndex;
  }

  void add_opaque(std::uint32_t pixel, std::vector<RenderFragment>& out) {
    const std::size_t corner = (pixel / kTilePx * kTileSamples + pixel % kTilePx) * kSamplesPerSide;
    if (const std::uint32_t whole = whole_pixel(corner); whole != kNoIndex) {
      out.push_back(fragment(whole, pixel, 0xFFFF, false));
      return;
    }
    std::uint32_t triangles[16];
    std::uint16_t masks[16];
    std::size_t count = 0;
    for (unsigned s = 0; s < 16; ++s) {
      const std::uint32_t t = nearest_[corner + s / 4 * kTileSamples + s % 4];
      if (t == kNoIndex) continue;
      std::size_t at = 0;
      while (at < count && triangles[at] != t) ++at;
      if (at == count) triangles[count] = t, masks[count++] = 0;
      masks[at] = static_cast<std::uint16_t>(masks[at] | 1u << s);
    }
    for (std::size_t i = 1; i < count; ++i)
      for (std::size_t k = i; k > 0 && triangles[k] < triangles[k - 1]; --k) {
        std::swap(triangles[k], triangles[k - 1]);
        std::swap(masks[k], masks[k - 1]);
      }
    for (std::size_t i = 0; i < count; ++i) out.push_back(fragment(triangles[i], pixel, masks[i], false));
  }

  const TileInput& input_;
  std::int32_t left_, top_;
  std::vector<float> depth_;  // nearness 1 / w, 0 = nothing
  std::vector<std::uint32_t> nearest_;
  SampleBox drawn_{kTileSamples, kTileSamples, -1, -1};  // by opaque triangles
  std::vector<std::uint16_t> masks_;
  std::vector<LayerHit> hits_;
  std::optional<TileTriangle> shown_;
  std::uint32_t shown_index_ = 0;
};

}  // namespace

std::array<Vec3d, 3> TileInput::corners_of(std::uint32_t triangle) const {
  const Triangle& t = (*scene->triangles)[triangle];
  const std::vector<std::uint32_t>& position = scene->mesh->wedge_position;
  return {seen[position[t[0]]], seen[position[t[1]]], seen[position[t[2]]]};
}

SampleBox sample_box(const std::array<Vec3d, 3>& corner, const SampleFrame& frame, double near) {
  double x_low = 1e9, x_high = -1e9, y_low = 1e9, y_high = -1e9;
  auto extend = [&](const Vec3d& p) {
    const double x = p.x / p.z + frame.half - 0.5, y = p.y / p.z + frame.half - 0.5;
    x_low = std::min(x_low, x), x_high = std::max(x_high, x);
    y_low = std::min(y_low, y), y_high = std::max(y_high, y);
  };
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3d &a = corner[k], &b = corner[k == 2 ? 0 : k + 1];
    if (a.z >= near) extend(a);
    if ((a.z < near) == (b.z < near)) continue;
    Vec3d cut = a + (b - a) * ((near - a.z) / (b.z - a.z));
    cut.z = near;
    extend(cut);
  }
  // Rounding of the projection is far below this part of a sample.
  constexpr double kMargin = 1e-3;
  auto whole = [&](double x) { return static_cast<std::int32_t>(std::clamp(x, -1., 2 * frame.half)); };
  return {std::max(whole(std::ceil(x_low - kMargin)), 0), std::max(whole(std::ceil(y_low - kMargin)), 0),
          std::min(whole(std::floor(x_high + kMargin)), static_cast<std::int32_t>(2 * frame.half) - 1),
          std::min(whole(std::floor(y_high + kMargin)), static_cast<std::int32_t>(2 * frame.half) - 1)};
}

TileFragments look_into_tile(const TileInput& input, std::uint32_t tile_x, std::uint32_t tile_y,
                             std::span<const std::uint32_t> triangles) {
  if (triangles.empty()) return {std::vector<std::uint32_t>(kTilePixels, 0), {}};
  Tile tile(input, tile_x, tile_y);
  bool layers = false;
  for (const std::uint32_t t : triangles) {
    if (input.scene->material_of(t).alpha_mode == AlphaMode::kOpaque)
      tile.draw_opaque(t);
    else
      layers = true;
  }
  if (layers)
    for (const std::uint32_t t : triangles)
      if (input.scene->material_of(t).alpha_mode != AlphaMode::kOpaque) tile.add_layer(t);
  return tile.finish();
}

}  // namespace texmesh
