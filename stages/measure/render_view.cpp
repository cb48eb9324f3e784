#include "stages/measure/render_view.h"

#include <algorithm>
#include <cmath>

#include "format/base/no_index.h"
#include "format/base/portable_math.h"

namespace texmesh {
namespace {

constexpr int kOversampling = 2;
constexpr float kBackground = 0.2f;  // linear: a mid grey, so that neither bright nor dark rims are favoured
constexpr double kAmbient = 0.3;
constexpr double kFill = 0.96;  // of the picture's side

struct Projected {
  double x, y, depth;  // samples; larger depth is nearer
};

double edge(const Projected& a, const Projected& b, double x, double y) {
  return (a.x - x) * (b.y - y) - (a.y - y) * (b.x - x);
}

// Triangles that share an edge see it with both signs of exactly the same number, so no sample falls between
// them.
std::vector<std::uint32_t> rasterise(const std::vector<Projected>& points, const Mesh& mesh,
                                     const std::vector<Triangle>& triangles, std::uint32_t side) {
  std::vector<std::uint32_t> nearest(static_cast<std::size_t>(side) * side, kNoIndex);
  std::vector<double> depth(nearest.size(), -1e300);
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const Projected &a = points[mesh.wedge_position[triangles[t][0]]],
                    &b = points[mesh.wedge_position[triangles[t][1]]],
                    &c = points[mesh.wedge_position[triangles[t][2]]];
    const double area = edge(a, b, c.x, c.y);
    if (area == 0) continue;
    const auto [x_lo, x_hi] = std::minmax({a.x, b.x, c.x});
    const auto [y_lo, y_hi] = std::minmax({a.y, b.y, c.y});
    // Sample (x, y) lies at x + 0.5, y + 0.5.
    const auto x0 = static_cast<std::uint32_t>(std::clamp<double>(std::ceil(x_lo - 0.5), 0, side));
    const auto y0 = static_cast<std::uint32_t>(std::clamp<double>(std::ceil(y_lo - 0.5), 0, side));
    for (std::uint32_t y = y0; y < side && y + 0.5 <= y_hi; ++y)
      for (std::uint32_t x = x0; x < side && x + 0.5 <= x_hi; ++x) {
        const double u = edge(b, c, x + 0.5, y + 0.5), v = edge(c, a, x + 0.5, y + 0.5),
                     w = edge(a, b, x + 0.5, y + 0.5);
        if (area > 0 ? (u < 0 || v < 0 || w < 0) : (u > 0 || v > 0 || w > 0)) continue;
        const double d = (u * a.depth + v * b.depth + w * c.depth) / area;
        const std::size_t i = static_cast<std::size_t>(y) * side + x;
        if (d > depth[i]) {
          depth[i] = d;
          nearest[i] = t;
        }
      }
  }
  return nearest;
}

struct UvLookup {
  std::int32_t plane = -1;
  Vec2d corner[3];
  float area = 0;  // texels per sample
  bool repeat_s = true, repeat_t = true;
};

Vec2d transformed(const UvTransform& t, Vec2f uv) {
  if (t.is_identity()) return to_double(uv);
  const double c = portable::cos(t.rotation), s = portable::sin(t.rotation);
  const double x = static_cast<double>(uv.x) * t.scale.x, y = static_cast<double>(uv.y) * t.scale.y;
  return {t.offset.x + c * x + s * y, t.offset.y - s * x + c * y};
}

UvLookup lookup_of(const ViewScene& scene, const TextureRef& ref, std::int32_t plane,
                   const Triangle& triangle, double sample_area) {
  UvLookup out;
  const std::vector<Vec2f>& uv = ref.texcoord == 1 ? scene.mesh->uv1 : scene.mesh->uv0;
  if (plane < 0 || uv.empty()) return out;
  out.plane = plane;
  for (std::size_t k = 0; k < 3; ++k) out.corner[k] = transformed(ref.transform, uv[triangle[k]]);
  const Vec2<std::uint32_t> size = scene.sizes[static_cast<std::size_t>(plane)];
  const double uv_area = std::fabs(cross(out.corner[1] - out.corner[0], out.corner[2] - out.corner[0]));
  out.area = static_cast<float>(std::min(1e30, uv_area * size.x * size.y / sample_area));
  out.repeat_s = ref.wrap_s != Wrap::kClamp;
  out.repeat_t = ref.wrap_t != Wrap::kClamp;
  return out;
}

double mirrored(double x) {
  const double t = x - 2 * std::floor(x / 2);
  return t < 1 ? t : 2 - t;
}

Vec2f uv_at(const UvLookup& lookup, const TextureRef& ref, const double weight[3]) {
  Vec2d uv;
  for (int k = 0; k < 3; ++k) uv = uv + lookup.corner[k] * weight[k];
  auto wrap = [](double x, Wrap mode) {
    if (mode == Wrap::kClamp) return std::clamp(x, 0.0, 1.0);
    return mode == Wrap::kMirror ? mirrored(x) : x - std::floor(x);
  };
  return {static_cast<float>(wrap(uv.x, ref.wrap_s)), static_cast<float>(wrap(uv.y, ref.wrap_t))};
}

// All that samples of one triangle share.
struct TriangleShade {
  Vec3d normal[3];
  Vec4f colour[3];
  UvLookup base, emissive;
  const Material* material = nullptr;
};

TriangleShade shade_of(const ViewScene& scene, std::uint32_t t, double sample_area) {
  const Mesh& mesh = *scene.mesh;
  const Triangle& triangle = (*scene.triangles)[t];
  const std::size_t m = mesh.triangle_material[(*scene.triangle_source)[t]];
  TriangleShade s;
  s.material = &(*scene.materials)[m];
  auto position = [&](std::size_t k) { return to_double(mesh.positions[mesh.wedge_position[triangle[k]]]); };
  const Vec3d face = normalized(cross(position(1) - position(0), position(2) - position(0)));
  for (std::size_t k = 0; k < 3; ++k) {
    s.normal[k] = mesh.normals.empty() ? face : to_double(mesh.normals[triangle[k]]);
    s.colour[k] = mesh.colours.empty() ? Vec4f{1, 1, 1, 1} : mesh.colours[triangle[k]];
  }
  s.base = lookup_of(scene, s.material->base_colour_texture, scene.base_plane[m], triangle, sample_area);
  s.emissive = lookup_of(scene, s.material->emissive_texture, scene.emissive_plane[m], triangle, sample_area);
  return s;
}

ViewSample sample_of(const TriangleShade& s, const double weight[3], Vec3d towards_viewer) {
  Vec3d normal, colour;
  for (int k = 0; k < 3; ++k) {
    normal = normal + s.normal[k] * weight[k];
    colour = colour + Vec3d{s.colour[k].x, s.colour[k].y, s.colour[k].z} * weight[k];
  }
  const double facing = std::min(1.0, std::fabs(dot(normalized(normal), towards_viewer)));
  const double light = s.material->unlit ? 1 : kAmbient + (1 - kAmbient) * facing;
  const Vec4f f = s.material->base_colour;
  ViewSample out;
  out.factor = to_float(Vec3d{colour.x * f.x, colour.y * f.y, colour.z * f.z} * light);
  out.emission = s.material->emissive;
  out.base_plane = s.base.plane;
  out.emissive_plane = s.emissive.plane;
  out.base_area = s.base.area;
  out.emissive_area = s.emissive.area;
  out.base_repeat_s = s.base.repeat_s, out.base_repeat_t = s.base.repeat_t;
  out.emissive_repeat_s = s.emissive.repeat_s, out.emissive_repeat_t = s.emissive.repeat_t;
  if (out.base_plane >= 0) out.base_uv = uv_at(s.base, s.material->base_colour_texture, weight);
  if (out.emissive_plane >= 0) out.emissive_uv = uv_at(s.emissive, s.material->emissive_texture, weight);
  return out;
}

// The level whose texels are nearest in size to the footprint (a factor 2 of area either way), then bilinear.
Vec3f filtered_texel(const MipTexture& texture, Vec2f uv, float area, bool repeat_s, bool repeat_t) {
  std::size_t level = 0;
  for (float limit = 2; area > limit && level + 1 < texture.first_level + texture.levels.size(); limit *= 4)
    ++level;
  const MipTexture::Level& l = texture.levels[level > texture.first_level ? level - texture.first_level : 0];
  auto neighbours = [](float x, std::uint32_t size, bool repeat, std::uint32_t& a, std::uint32_t& b) {
    const float at = x * static_cast<float>(size) - 0.5f, low = std::floor(at);
    const auto i = static_cast<std::int64_t>(low), n = static_cast<std::int64_t>(size);
    auto place = [&](std::int64_t k) {
      return static_cast<std::uint32_t>(repeat ? (k + n) % n : std::clamp<std::int64_t>(k, 0, n - 1));
    };
    a = place(i);
    b = place(i + 1);
    return at - low;
  };
  std::uint32_t x0, x1, y0, y1;
  const float fx = neighbours(uv.x, l.width, repeat_s, x0, x1),
              fy = neighbours(uv.y, l.height, repeat_t, y0, y1);
  auto texel = [&l](std::uint32_t x, std::uint32_t y) {
    return l.texels[static_cast<std::size_t>(y) * l.width + x];
  };
  const Vec3f top = texel(x0, y0) * (1 - fx) + texel(x1, y0) * fx;
  const Vec3f bottom = texel(x0, y1) * (1 - fx) + texel(x1, y1) * fx;
  return top * (1 - fy) + bottom * fy;
}

}  // namespace

ViewCamera camera_of(int index, int count, Vec3d centre, double radius) {
  // A Fibonacci lattice on the sphere, starting a little to the side of the front.
  const double golden = portable::kPi * (3 - std::sqrt(5.0));
  const double height = count == 1 ? 0.2 : 1 - 2 * (index + 0.5) / count,
               ring = std::sqrt(1 - height * height);
  const double angle = 0.4 + golden * index;
  ViewCamera camera;
  camera.z = {ring * portable::sin(angle), height, ring * portable::cos(angle)};
  camera.x = normalized(cross(Vec3d{0, 1, 0}, camera.z));
  camera.y = cross(camera.z, camera.x);
  camera.centre = centre;
  camera.radius = radius;
  return camera;
}

void build_mips(MipTexture& texture) {
  for (;;) {
    const MipTexture::Level& last = texture.levels.back();
    if (last.width == 1 && last.height == 1) return;
    MipTexture::Level next;
    next.width = (last.width + 1) / 2;
    next.height = (last.height + 1) / 2;
    next.texels.resize(static_cast<std::size_t>(next.width) * next.height);
    for (std::uint32_t y = 0; y < next.height; ++y)
      for (std::uint32_t x = 0; x < next.width; ++x) {
        auto at = [&](std::uint32_t i, std::uint32_t j) {
          return last.texels[static_cast<std::size_t>(std::min(j, last.height - 1)) * last.width +
                             std::min(i, last.width - 1)];
        };
        next.texels[static_cast<std::size_t>(y) * next.width + x] =
            (at(2 * x, 2 * y) + at(2 * x + 1, 2 * y) + at(2 * x, 2 * y + 1) + at(2 * x + 1, 2 * y + 1)) *
            0.25f;
      }
    texture.levels.push_back(std::move(next));
  }
}

ViewBuffer look_at(const ViewScene& scene, const ViewCamera& camera, std::uint32_t side_px) {
  const std::uint32_t side = side_px * kOversampling;
  const double scale = kFill * side / (2 * camera.radius);
  std::vector<Projected> points;
  points.reserve(scene.mesh->positions.size());
  for (Vec3f p : scene.mesh->positions) {
    const Vec3d d = to_double(p) - camera.centre;
    points.push_back(
        {dot(d, camera.x) * scale + side * 0.5, side * 0.5 - dot(d, camera.y) * scale, dot(d, camera.z)});
  }
  const std::vector<std::uint32_t> nearest = rasterise(points, *scene.mesh, *scene.triangles, side);

  ViewBuffer out;
  out.side_px = side_px;
  out.hits.assign(static_cast<std::size_t>(side_px) * side_px, 0);
  TriangleShade shade;
  std::uint32_t shaded = kNoIndex;
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const std::uint32_t t = nearest[static_cast<std::size_t>(y) * side + x];
      if (t == kNoIndex) continue;
      const Triangle& triangle = (*scene.triangles)[t];
      const Projected &a = points[scene.mesh->wedge_position[triangle[0]]],
                      &b = points[scene.mesh->wedge_position[triangle[1]]],
                      &c = points[scene.mesh->wedge_position[triangle[2]]];
      const double area = edge(a, b, c.x, c.y), px = x + 0.5, py = y + 0.5;
      if (t != shaded) shade = shade_of(scene, t, std::fabs(area));
      shaded = t;
      const double weight[3] = {edge(b, c, px, py) / area, edge(c, a, px, py) / area,
                                edge(a, b, px, py) / area};
      ViewSample sample = sample_of(shade, weight, camera.z);
      sample.pixel = (y / kOversampling) * side_px + x / kOversampling;
      ++out.hits[sample.pixel];
      out.samples.push_back(sample);
    }
  return out;
}

Picture draw(const ViewBuffer& view, const std::vector<MipTexture>& textures) {
  constexpr int kSamples = kOversampling * kOversampling;
  Picture out;
  out.side_px = view.side_px;
  out.linear.resize(view.hits.size());
  out.covered.resize(view.hits.size());
  for (std::size_t i = 0; i < view.hits.size(); ++i) {
    const float background = kBackground * static_cast<float>(kSamples - view.hits[i]) / kSamples;
    out.linear[i] = {background, background, background};
    out.covered[i] = view.hits[i] > 0;
  }
  auto product = [](Vec3f a, Vec3f b) { return Vec3f{a.x * b.x, a.y * b.y, a.z * b.z}; };
  for (const ViewSample& s : view.samples) {
    Vec3f c = s.factor, e = s.emission;
    if (s.base_plane >= 0)
      c = product(c, filtered_texel(textures[static_cast<std::size_t>(s.base_plane)], s.base_uv, s.base_area,
                                    s.base_repeat_s, s.base_repeat_t));
    if (s.emissive_plane >= 0)
      e = product(e, filtered_texel(textures[static_cast<std::size_t>(s.emissive_plane)], s.emissive_uv,
                                    s.emissive_area, s.emissive_repeat_s, s.emissive_repeat_t));
    out.linear[s.pixel] = out.linear[s.pixel] + (c + e) * (1.f / kSamples);
  }
  return out;
}

}  // namespace texmesh
