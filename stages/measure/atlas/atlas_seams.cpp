#include <algorithm>
#include <cmath>

#include "format/base/srgb.h"
#include "stages/base/parallel.h"
#include "stages/measure/atlas/atlas_parts.h"
#include "stages/measure/cie_lab.h"

namespace texmesh {
namespace {

constexpr double kTexelsPerSample = 4;
constexpr double kMostSamples = 8;  // of one edge

/// The light of an image in between its texels, as viewers read it: bilinear, wrapped.
Vec3f light_at(const Pixels& p, Vec2d texels, const TextureRef& texture) {
  const double x = texels.x - 0.5, y = texels.y - 0.5, left = std::floor(x), top = std::floor(y);
  const std::array<float, 256>& light = light_of_bytes();
  Vec3f sum;
  for (const int dy : {0, 1})
    for (const int dx : {0, 1}) {
      const double weight = (dx ? x - left : 1 - (x - left)) * (dy ? y - top : 1 - (y - top));
      const std::uint8_t* at =
          p.at(wrapped(static_cast<std::int64_t>(left) + dx, p.width_px, texture.wrap_s),
               wrapped(static_cast<std::int64_t>(top) + dy, p.height_px, texture.wrap_t));
      const bool grey = p.channels < 3;
      sum = sum + Vec3f{light[at[0]], light[at[grey ? 0 : 1]], light[at[grey ? 0 : 2]]} *
                      static_cast<float>(weight);
    }
  return sum;
}

Vec3d lab_of(Vec3f light) {
  const Vec3d xyz = xyz_of_linear(light);
  const double x = lab_root(xyz.x / kWhiteXyz.x), y = lab_root(xyz.y), z = lab_root(xyz.z / kWhiteXyz.z);
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

/// One side of a seam, from one end to the other.
struct SeamSide {
  const Pixels* colours = nullptr;
  const TextureRef* texture = nullptr;
  Vec2d from, to, inwards;  // inwards: one texel long, or 0
  bool can_be_read() const {
    const auto near = [](Vec2d p) {
      return std::fabs(p.x) < 0x1p40 && std::fabs(p.y) < 0x1p40;  // finite, and a texel can be told
    };
    return colours && near(from) && near(to);
  }
  double texels() const { return std::sqrt(dot(to - from, to - from)); }
  Vec3d lab(double part, double depth_texels) const {
    return lab_of(light_at(*colours, from + (to - from) * part + inwards * depth_texels, *texture));
  }
};

SeamSide side_of(const AtlasLayout& layout, std::uint32_t half_edge, std::span<const AtlasImage> images) {
  const std::uint32_t t = half_edge / 3, k = half_edge % 3;
  const TextureRef* texture = layout.texture(t);
  const std::array<Vec2d, 3> at = layout.texels(t);
  const Vec2d along = at[(k + 1) % 3] - at[k], across{-along.y, along.x};
  const double length = std::sqrt(dot(along, along));
  const double side = dot(across, at[(k + 2) % 3] - at[k]) < 0 ? -1 : 1;
  const Vec2d inwards = length > 0 ? across * (side / length) : Vec2d{};
  return {images[static_cast<std::size_t>(texture->image)].colours, texture, at[k], at[(k + 1) % 3], inwards};
}

/// Means along a seam, and its length in space; weight 0 where nothing can be compared.
struct SeamDifference {
  double across = 0, inside = 0, weight = 0;
};

SeamDifference difference_along(const AtlasLayout& layout, const AtlasSeam& seam,
                                std::span<const AtlasImage> images) {
  const SeamSide a = side_of(layout, seam.first, images);
  SeamSide b = side_of(layout, seam.second, images);
  if (!a.can_be_read() || !b.can_be_read()) return {};
  if (seam.opposite) std::swap(b.from, b.to);
  const double longer = std::max(a.texels(), b.texels());
  const int samples = static_cast<int>(std::clamp(std::ceil(longer / kTexelsPerSample), 1.0, kMostSamples));
  double across = 0, inside = 0;
  for (int k = 0; k < samples; ++k) {
    const double part = (k + 0.5) / samples;
    const Vec3d here = a.lab(part, 0), there = b.lab(part, 0);
    across += length(here - there);
    inside += (length(here - a.lab(part, 1)) + length(there - b.lab(part, 1))) / 2;
  }
  const std::array<Vec3d, 3> p = layout.points(seam.first / 3);
  const double weight = length(p[(seam.first % 3 + 1) % 3] - p[seam.first % 3]);
  return {across / samples, inside / samples, std::isfinite(weight) ? weight : 0};
}

}  // namespace

std::vector<std::optional<SeamColours>> measure_seams(const AtlasLayout& layout, const AtlasCharts& charts,
                                                      std::span<const AtlasImage> images, std::size_t atlases,
                                                      const RunContext& context) {
  std::vector<SeamDifference> differences(charts.seams.size());
  parallel_for(context, differences.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s)
      differences[s] = difference_along(layout, charts.seams[s], images);
  });
  std::vector<std::vector<WeighedValue>> of_atlas(atlases);
  std::vector<double> inside(atlases);
  for (std::size_t s = 0; s < differences.size(); ++s) {
    const std::uint32_t chart = charts.chart_of_triangle[charts.seams[s].first / 3];
    const SeamDifference& d = differences[s];
    if (!(d.weight > 0)) continue;
    of_atlas[charts.charts[chart].atlas].push_back({d.across, d.weight});
    inside[charts.charts[chart].atlas] += d.inside * d.weight;
  }
  std::vector<std::optional<SeamColours>> out(atlases);
  for (std::size_t a = 0; a < atlases; ++a) {
    if (of_atlas[a].empty()) continue;
    double sum = 0, weight = 0;
    for (const WeighedValue& v : of_atlas[a]) sum += v.value * v.weight, weight += v.weight;
    std::ranges::sort(of_atlas[a]);
    out[a] = SeamColours{sum / weight, weighed_percentile(of_atlas[a], 0.95), inside[a] / weight};
  }
  return out;
}

}  // namespace texmesh
