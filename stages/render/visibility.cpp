#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"
#include "stages/render/visibility_tile.h"

namespace texmesh {
namespace {

constexpr double kFill = 0.96;  // of the picture's side
constexpr double kNearOfDistance = 1e-3;

double tan_of_half(double degrees) {
  const double half = degrees * portable::kPi / 360;
  return portable::sin(half) / portable::cos(half);
}

float within(float value, float low, float high, float otherwise) {
  if (!std::isfinite(value)) return otherwise;
  return value < low ? low : value > high ? high : value;
}

float emission_strength(const Material& material) {
  for (const MaterialExtension& extension : material.extensions)
    if (extension.name == "KHR_materials_emissive_strength")
      for (const ExtensionFactor& factor : extension.factors)
        if (factor.key == "emissiveStrength" && !factor.values.empty())
          return within(factor.values[0], 0, 1e6f, 1);
  return 1;
}

MinFilter min_filter_of(Minification minification) {
  if (minification == Minification::kNearest) return MinFilter::kNearest;
  // The renderer has one filter with mip levels.
  return minification == Minification::kLinear ? MinFilter::kLinear : MinFilter::kTrilinear;
}

UvTransform finite_transform(const UvTransform& t) {
  const bool finite = std::isfinite(t.offset.x) && std::isfinite(t.offset.y) && std::isfinite(t.scale.x) &&
                      std::isfinite(t.scale.y) && std::fabs(t.rotation) <= 1e6f;
  return finite ? t : UvTransform{};
}

constexpr std::uint32_t kMostSide = 8192;

void require(bool held, const char* what) {
  if (!held) throw std::invalid_argument(what);
}

void check_scene(const RenderScene& scene) {
  const Mesh& mesh = *scene.mesh;
  const std::size_t wedges = mesh.wedge_count(), triangles = scene.triangles->size();
  require(!scene.triangle_source || scene.triangle_source->size() == triangles,
          "look: a triangle has no source");
  for (const std::uint32_t p : mesh.wedge_position)
    require(p < mesh.positions.size(), "look: a wedge's position is beyond the mesh");
  for (std::size_t t = 0; t < triangles; ++t) {
    for (const std::uint32_t wedge : (*scene.triangles)[t])
      require(wedge < wedges, "look: a triangle's wedge is beyond the mesh");
    const std::size_t source = scene.triangle_source ? (*scene.triangle_source)[t] : t;
    require(
        source < mesh.triangle_material.size() && mesh.triangle_material[source] < scene.materials->size(),
        "look: a triangle's material is beyond the materials");
  }
}

void check_camera(const RenderCamera& camera) {
  double sum = camera.tan_half_fov + camera.near;
  for (const Vec3d& v : {camera.eye, camera.x, camera.y, camera.z}) sum += v.x + v.y + v.z;
  require(std::isfinite(sum) && camera.tan_half_fov > 0 && camera.near > 0, "look: no camera");
}

/// The triangles of every tile by rising index: those of tile i stand from first[i] on.
struct Bins {
  std::vector<std::size_t> first;
  std::vector<std::uint32_t> triangles;
};

void for_each_tile(const SampleBox& box, std::uint32_t tiles, auto f) {
  if (box.empty()) return;
  constexpr auto kSide = static_cast<std::int32_t>(kTileSamples);
  for (std::int32_t y = box.y_first / kSide; y <= box.y_last / kSide; ++y)
    for (std::int32_t x = box.x_first / kSide; x <= box.x_last / kSide; ++x)
      f(static_cast<std::size_t>(y) * tiles + static_cast<std::size_t>(x));
}

/// Those that nobody looks at stay empty.
Bins sorted_into_tiles(const std::vector<SampleBox>& boxes, std::uint32_t tiles,
                       std::span<const std::uint8_t> bands) {
  Bins bins;
  bins.first.assign(static_cast<std::size_t>(tiles) * tiles + 1, 0);
  for (const SampleBox& box : boxes) for_each_tile(box, tiles, [&](std::size_t i) { ++bins.first[i + 1]; });
  const auto looks_at = [&](std::size_t tile) { return bands.empty() || bands[tile / tiles] != 0; };
  for (std::size_t i = 0; i + 1 < bins.first.size(); ++i)
    if (!looks_at(i)) bins.first[i + 1] = 0;
  for (std::size_t i = 1; i < bins.first.size(); ++i) bins.first[i] += bins.first[i - 1];
  bins.triangles.resize(bins.first.back());
  std::vector<std::size_t> next(bins.first.begin(), bins.first.end() - 1);
  for (std::uint32_t t = 0; t < boxes.size(); ++t)
    for_each_tile(boxes[t], tiles, [&](std::size_t i) {
      if (looks_at(i)) bins.triangles[next[i]++] = t;
    });
  return bins;
}

TileInput tile_input(const RenderScene& scene, const RenderCamera& camera, std::uint32_t side_px,
                     const RunContext& context) {
  TileInput input{&scene, SampleFrame(camera, side_px), camera.near, side_px, {}, {}, true};
  input.seen.resize(scene.mesh->positions.size());
  parallel_each(context, input.seen.size(), 4096, [&](std::size_t i) {
    input.seen[i] = seen_from(camera, input.frame, scene.mesh->positions[i]);
  });
  input.boxes.resize(scene.triangles->size());
  parallel_each(context, input.boxes.size(), 4096, [&](std::size_t t) {
    const auto triangle = static_cast<std::uint32_t>(t);
    const std::array<Vec3d, 3> corners = input.corners_of(triangle);
    const EdgePlanes planes = edge_planes(corners);
    if (planes.visible && (planes.front || scene.material_of(triangle).double_sided))
      input.boxes[t] = sample_box(corners, input.frame, camera.near);
  });
  return input;
}

/// Corners and boxes of triangles are gone when tiles are joined: 100,000 triangles have 5 MB of them.
std::vector<TileFragments> look_into_tiles(const RenderScene& scene, const RenderCamera& camera,
                                           std::uint32_t side_px, std::uint32_t tiles,
                                           std::span<const std::uint8_t> bands, const RunContext& context) {
  const TileInput input = tile_input(scene, camera, side_px, context);
  const Bins bins = sorted_into_tiles(input.boxes, tiles, bands);
  std::vector<TileFragments> parts(bins.first.size() - 1);
  parallel_each(context, parts.size(), 1, [&](std::size_t i) {
    const auto tile = static_cast<std::uint32_t>(i);
    parts[i] = look_into_tile(input, tile % tiles, tile / tiles,
                              {bins.triangles.data() + bins.first[i], bins.first[i + 1] - bins.first[i]});
  });
  return parts;
}

/// Puts the pixels of all tiles into raster order. Tiles are empty behind it.
void join_tiles(std::vector<TileFragments>& parts, std::uint32_t tiles, const RunContext& context,
                Visibility& out) {
  const std::size_t side = out.side_px;
  auto part_of = [&](std::size_t x, std::size_t y) -> const TileFragments& {
    return parts[y / kTilePx * tiles + x / kTilePx];
  };
  out.first.assign(side * side + 1, 0);
  for (std::size_t y = 0; y < side; ++y)
    for (std::size_t x = 0; x < side; ++x)
      out.first[y * side + x + 1] =
          out.first[y * side + x] + part_of(x, y).count[y % kTilePx * kTilePx + x % kTilePx];
  out.fragments.resize(out.first.back());
  parallel_for(context, parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      auto from = parts[i].fragments.begin();
      for (std::size_t p = 0; p < parts[i].count.size(); ++p) {
        const std::size_t x = i % tiles * kTilePx + p % kTilePx, y = i / tiles * kTilePx + p / kTilePx;
        if (x >= side || y >= side) continue;
        const auto count = static_cast<std::ptrdiff_t>(parts[i].count[p]);
        std::copy(from, from + count,
                  out.fragments.begin() + static_cast<std::ptrdiff_t>(out.first[y * side + x]));
        from += count;
      }
      parts[i] = {};
    }
  });
}

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
    const std::array<Vec3d, 3> c = input.corners_of(triangle);
    for (const Vec3d& corner : c)
      if (corner.z < input.near) return;  // the range below holds for what is wholly in front
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
  std::uint32_t pixel = 0, place = 0;  // of the triangle
  float nearness = 0;
  std::uint16_t mask = 0;
};
bool before(const LayerHit& a, const LayerHit& b) {
  if (a.pixel != b.pixel) return a.pixel < b.pixel;
  if (a.nearness != b.nearness) return a.nearness > b.nearness;
  return a.place < b.place;
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

  /// By rising index.
  void draw_opaque(std::uint32_t t) { add(t, &Tile::draw); }
  /// The same, behind all opaque triangles.
  void add_layer(std::uint32_t t) { add(t, &Tile::put_layer); }

  TileFragments finish() {
    keep_nearest(hits_);
    TileFragments out;
    out.count.assign(kTilePixels, 0);
    auto hit = hits_.begin();
    for (std::uint32_t pixel = 0; pixel < kTilePixels; ++pixel) {
      const std::size_t before_pixel = out.fragments.size();
      for (; hit != hits_.end() && hit->pixel == pixel; ++hit)
        out.fragments.push_back(fragment(hit->place, pixel, hit->mask, true));
      if (may_be_drawn(pixel)) add_opaque(pixel, out.fragments);
      out.count[pixel] = static_cast<std::uint32_t>(out.fragments.size() - before_pixel);
    }
    return out;
  }

 private:
  /// Keeps the triangle if it is seen from this side, and `is_drawn` finds it in a sample.
  void add(std::uint32_t t, bool (Tile::*is_drawn)(const TileTriangle&, std::uint32_t place)) {
    const auto place = static_cast<std::uint32_t>(triangles_.size());
    const TileTriangle& triangle = triangles_.emplace_back(t, TileTriangle(input_, t, left_, top_)).second;
    const EdgePlanes& planes = triangle.planes();
    const bool shows = planes.visible && (planes.front || input_.scene->material_of(t).double_sided);
    if (!shows || !(this->*is_drawn)(triangle, place)) triangles_.pop_back();
  }

  bool draw(const TileTriangle& triangle, std::uint32_t place) {
    const SampleBox& box = triangle.box();
    drawn_ = {std::min(drawn_.x_first, box.x_first), std::min(drawn_.y_first, box.y_first),
              std::max(drawn_.x_last, box.x_last), std::max(drawn_.y_last, box.y_last)};
    bool seen = false;
    triangle.for_each_sample([&](std::int32_t x, std::int32_t y, double nearness) {
      const std::size_t i = static_cast<std::size_t>(y) * kTileSamples + static_cast<std::size_t>(x);
      const auto d = static_cast<float>(nearness);
      if (!(d > depth_[i])) return;
      depth_[i] = d;
      nearest_[i] = place;
      seen = true;
    });
    return seen;
  }

  bool put_layer(const TileTriangle& triangle, std::uint32_t place) {
    masks_.assign(kTilePixels, 0);
    bool seen = false;
    triangle.for_each_sample([&](std::int32_t x, std::int32_t y, double nearness) {
      const std::size_t i = static_cast<std::size_t>(y) * kTileSamples + static_cast<std::size_t>(x);
      if (static_cast<float>(nearness) < depth_[i]) return;
      masks_[pixel_of(x, y)] |= static_cast<std::uint16_t>(1u << bit_of(x, y));
      seen = true;
    });
    const SampleBox& box = triangle.box();
    for (std::int32_t y = box.y_first / kSamplesPerSide; y <= box.y_last / kSamplesPerSide; ++y)
      for (std::int32_t x = box.x_first / kSamplesPerSide; x <= box.x_last / kSamplesPerSide; ++x) {
        const std::uint32_t pixel = static_cast<std::uint32_t>(y) * kTilePx + static_cast<std::uint32_t>(x);
        if (masks_[pixel] == 0) continue;
        const Vec2d mean = mean_of_samples(masks_[pixel]);
        hits_.push_back({pixel, place,
                         static_cast<float>(
                             triangle.nearness(x * kSamplesPerSide + mean.x, y * kSamplesPerSide + mean.y)),
                         masks_[pixel]});
      }
    if (hits_.size() > kMostHits) keep_nearest(hits_);
    return seen;
  }

  bool may_be_drawn(std::uint32_t pixel) const {
    const auto x = static_cast<std::int32_t>(pixel % kTilePx), y = static_cast<std::int32_t>(pixel / kTilePx);
    return x >= drawn_.x_first / kSamplesPerSide && x <= drawn_.x_last / kSamplesPerSide &&
           y >= drawn_.y_first / kSamplesPerSide && y <= drawn_.y_last / kSamplesPerSide;
  }

  RenderFragment fragment(std::uint32_t place, std::uint32_t pixel, std::uint16_t mask, bool layer) const {
    const auto& [index, triangle] = triangles_[place];
    return triangle.fragment(index, pixel, mask, layer);
  }

  /// The place of the triangle that all samples of a pixel show, if one does.
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
    std::uint32_t places[16];
    std::uint16_t masks[16];
    std::size_t count = 0;
    for (unsigned s = 0; s < 16; ++s) {
      const std::uint32_t place = nearest_[corner + s / 4 * kTileSamples + s % 4];
      if (place == kNoIndex) continue;
      std::size_t at = 0;
      while (at < count && places[at] != place) ++at;
      if (at == count) places[count] = place, masks[count++] = 0;
      masks[at] = static_cast<std::uint16_t>(masks[at] | 1u << s);
    }
    for (std::size_t i = 1; i < count; ++i)
      for (std::size_t k = i; k > 0 && places[k] < places[k - 1]; --k) {
        std::swap(places[k], places[k - 1]);
        std::swap(masks[k], masks[k - 1]);
      }
    for (std::size_t i = 0; i < count; ++i) out.push_back(fragment(places[i], pixel, masks[i], false));
  }

  const TileInput& input_;
  std::int32_t left_, top_;
  std::vector<std::pair<std::uint32_t, TileTriangle>>
      triangles_;                                        // that samples have shown, rising; opaque first
  std::vector<float> depth_;                             // nearness 1 / w, 0 = nothing
  std::vector<std::uint32_t> nearest_;                   // place in triangles_
  SampleBox drawn_{kTileSamples, kTileSamples, -1, -1};  // by opaque triangles
  std::vector<std::uint16_t> masks_;
  std::vector<LayerHit> hits_;
};

}  // namespace

BoundingSphere sphere_around(const Mesh& finest, const char* stage) {
  if (finest.positions.empty()) throw StageError(stage, "S_0", "positions", "none");
  const BoundingSphere sphere = bounding_sphere(finest.positions);
  if (!(sphere.radius > 0)) throw StageError(stage, "S_0", "an extent above 0", "one point");
  return sphere;
}

ViewCamera view_towards(Vec3d z, const BoundingSphere& bounds) {
  const Vec3d x = normalized(cross(Vec3d{0, 1, 0}, z));
  return {x, cross(z, x), z, bounds.centre, bounds.radius};
}

ViewCamera camera_of(int index, int count, Vec3d centre, double radius) {
  // A Fibonacci lattice on the sphere, starting a little to the side of the front.
  const double golden = portable::kPi * (3 - std::sqrt(5.0));
  const double height = count == 1 ? 0.2 : 1 - 2 * (index + 0.5) / count,
               ring = std::sqrt(1 - height * height);
  const double angle = 0.4 + golden * index;
  const Vec3d z{ring * portable::sin(angle), height, ring * portable::cos(angle)};
  return view_towards(z, {centre, radius});
}

RenderCamera perspective_camera(const ViewCamera& view, double fov_degrees) {
  const double radius = std::isfinite(view.radius) && view.radius > 0 ? view.radius : 1;
  RenderCamera camera;
  camera.x = view.x, camera.y = view.y, camera.z = view.z;
  camera.tan_half_fov = tan_of_half(fov_degrees);
  // The rays that touch the sphere have the tangent radius / sqrt(distance^2 - radius^2).
  const double tangent = kFill * camera.tan_half_fov;
  const double distance = radius * std::sqrt(1 + 1 / (tangent * tangent));
  camera.eye = view.centre + view.z * distance;
  camera.near = distance * kNearOfDistance;
  return camera;
}

RenderCamera look_at_camera(Vec3d eye, Vec3d target, Vec3d up, double fov_degrees, double near) {
  RenderCamera camera;
  camera.eye = eye;
  camera.z = normalized(eye - target);
  if (!(length(camera.z) > 0)) camera.z = {0, 0, 1};
  for (const Vec3d direction : {normalized(up), Vec3d{0, 1, 0}, Vec3d{0, 0, -1}}) {
    camera.x = cross(direction, camera.z);
    if (length(camera.x) > 1e-9) break;
  }
  camera.x = normalized(camera.x);
  camera.y = cross(camera.z, camera.x);
  camera.tan_half_fov = tan_of_half(fov_degrees);
  camera.near = near;
  return camera;
}

RenderMaterial render_material(const Material& material,
                               const std::function<std::int32_t(const TextureRef&, TextureUse)>& texture_of) {
  constexpr float kMost = 1e6f;
  RenderMaterial out;
  const Vec4f c = material.base_colour;
  out.base_colour = {within(c.x, 0, 1, 1), within(c.y, 0, 1, 1), within(c.z, 0, 1, 1), within(c.w, 0, 1, 1)};
  out.metallic = within(material.metallic, 0, 1, 1);
  out.roughness = within(material.roughness, 0, 1, 1);
  for (int k = 0; k < 3; ++k)
    out.emissive[k] = within(material.emissive[k], 0, 1, 0) * emission_strength(material);
  out.normal_scale = within(material.normal_scale, -kMost, kMost, 1);
  out.occlusion_strength = within(material.occlusion_strength, 0, 1, 1);
  out.alpha_mode = material.alpha_mode;
  out.alpha_cutoff = within(material.alpha_cutoff, 0, kMost, 0.5f);
  out.double_sided = material.double_sided;
  out.unlit = material.unlit;
  const TextureRef* refs[kTextureUses] = {&material.base_colour_texture, &material.metallic_roughness_texture,
                                          &material.normal_texture, &material.occlusion_texture,
                                          &material.emissive_texture};
  for (std::size_t use = 0; use < kTextureUses; ++use) {
    const TextureRef& ref = *refs[use];
    if (!ref.used()) continue;
    TextureSlot& slot = out.textures[use];
    slot.texture = texture_of(ref, static_cast<TextureUse>(use));
    slot.uv_set = ref.texcoord;
    slot.wrap_s = ref.wrap_s;
    slot.wrap_t = ref.wrap_t;
    slot.mag_filter = ref.nearest ? MagFilter::kNearest : MagFilter::kLinear;
    slot.min_filter = min_filter_of(ref.minification);
    slot.transform = finite_transform(ref.transform);
  }
  return out;
}

RenderScene render_scene(const Mesh& mesh, const std::vector<RenderMaterial>& materials,
                         std::size_t texture_count) {
  return {&mesh, &mesh.triangles, nullptr, &materials, texture_count};
}

Visibility look(const RenderScene& scene, const RenderCamera& camera, std::uint32_t side_px,
                const RunContext& context, std::span<const std::uint8_t> bands) {
  static_assert(kBandPx == kTilePx);
  require(side_px > 0 && side_px <= kMostSide, "look: a picture has 1 to 8192 pixels a side");
  check_camera(camera);
  check_scene(scene);
  const std::uint32_t tiles = (side_px + kTilePx - 1) / kTilePx;
  require(bands.empty() || bands.size() == tiles, "look: as many bands as the picture has");
  std::vector<TileFragments> parts = look_into_tiles(scene, camera, side_px, tiles, bands, context);
  Visibility out;
  out.side_px = side_px;
  out.camera = camera;
  join_tiles(parts, tiles, context, out);
  return out;
}

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
