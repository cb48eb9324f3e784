#include <algorithm>
#include <cstdio>  // jpeglib.h needs FILE and size_t
#include <cstdlib>

#include <jpeglib.h>

#include "examples/scan_model.h"
#include "examples/scan_noise.h"
#include "format/base/portable_math.h"
#include "format/base/vec.h"
#include "stages/base/parallel.h"

namespace texmesh {
namespace {

struct TriangleInAtlas {
  Vec2d corner[3];  // px
  double inverse_area = 0;
};

TriangleInAtlas in_atlas(const Mesh& mesh, std::uint32_t t, double side) {
  TriangleInAtlas a;
  for (std::size_t k = 0; k < 3; ++k) a.corner[k] = to_double(mesh.uv0[mesh.triangles[t][k]]) * side;
  const double area = cross(a.corner[1] - a.corner[0], a.corner[2] - a.corner[0]);
  a.inverse_area = area != 0 ? 1 / area : 0;
  return a;
}

Vec3d barycentric(const TriangleInAtlas& a, Vec2d p) {
  const double u = cross(a.corner[1] - p, a.corner[2] - p) * a.inverse_area;
  const double v = cross(a.corner[2] - p, a.corner[0] - p) * a.inverse_area;
  return {u, v, 1 - u - v};
}

// Which triangle every texel belongs to: those whose middle it contains, then a rim of `rim` texels around
// each chart that bilinear sampling needs (painted from the triangle next to it, by extrapolation).
std::vector<std::uint32_t> texel_triangles(const Mesh& mesh, std::uint32_t side, int rim) {
  std::vector<std::uint32_t> owner(static_cast<std::size_t>(side) * side, kNoIndex);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const TriangleInAtlas a = in_atlas(mesh, t, side);
    if (a.inverse_area == 0) continue;
    auto bound = [side](double x) { return static_cast<std::uint32_t>(std::clamp(x, 0.0, side - 1.0)); };
    const auto [x0, x1] = std::minmax({a.corner[0].x, a.corner[1].x, a.corner[2].x});
    const auto [y0, y1] = std::minmax({a.corner[0].y, a.corner[1].y, a.corner[2].y});
    for (std::uint32_t y = bound(y0); y <= bound(y1); ++y)
      for (std::uint32_t x = bound(x0); x <= bound(x1); ++x) {
        const Vec3d b = barycentric(a, {x + 0.5, y + 0.5});
        if (b.x >= 0 && b.y >= 0 && b.z >= 0) owner[static_cast<std::size_t>(y) * side + x] = t;
      }
  }
  std::vector<std::pair<std::size_t, std::uint32_t>> grown;
  for (int step = 0; step < rim; ++step) {
    grown.clear();
    for (std::uint32_t y = 0; y < side; ++y)
      for (std::uint32_t x = 0; x < side; ++x) {
        const std::size_t i = static_cast<std::size_t>(y) * side + x;
        if (owner[i] != kNoIndex) continue;
        std::uint32_t best = kNoIndex;
        if (x > 0) best = std::min(best, owner[i - 1]);
        if (x + 1 < side) best = std::min(best, owner[i + 1]);
        if (y > 0) best = std::min(best, owner[i - side]);
        if (y + 1 < side) best = std::min(best, owner[i + side]);
        if (best != kNoIndex) grown.emplace_back(i, best);
      }
    for (const auto& [i, t] : grown) owner[i] = t;
  }
  return owner;
}

std::uint8_t to_byte(double x) { return static_cast<std::uint8_t>(std::lround(255 * clamp01(x))); }

// What the camera adds: exposure and white balance of the photograph a chart was cut from, and the sensor's
// grain.
Vec3d through_camera(Vec3d colour, std::uint32_t chart, std::uint32_t x, std::uint32_t y,
                     std::uint32_t seed) {
  const double exposure = 1 + 0.06 * (hash01(chart, 1, 0, seed) - 0.5);
  const double warmth = 0.03 * (hash01(chart, 2, 0, seed) - 0.5);
  const double luma = hash01(x, y, 3, seed) + hash01(x, y, 4, seed) - 1;
  Vec3d c = colour * exposure + Vec3d{warmth, 0, -warmth};
  for (std::uint32_t k = 0; k < 3; ++k)
    c[static_cast<int>(k)] += 0.014 * luma + 0.010 * (hash01(x, y, 5 + k, seed) - 0.5);
  return c;
}

Pixels blank(std::uint32_t width, std::uint32_t height) {
  return {width, height, 3, std::vector<std::uint8_t>(static_cast<std::size_t>(width) * height * 3, 0)};
}

void put(Pixels& pixels, std::size_t texel, Vec3d c) {
  for (int k = 0; k < 3; ++k) pixels.data[texel * 3 + static_cast<std::size_t>(k)] = to_byte(c[k]);
}

// glTF's tangent space: red along u, green towards the top of the image.
void derive_normals(const std::vector<float>& height, const std::vector<std::uint32_t>& owner,
                    double texel_size, Pixels& out, const RunContext& context) {
  const std::uint32_t side = out.width_px;
  parallel_for(context, side, 32, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y)
      for (std::size_t x = 0; x < side; ++x) {
        const std::size_t i = y * side + x;
        if (owner[i] == kNoIndex) continue;
        auto at = [&](std::size_t j, bool inside) {
          return inside && owner[j] != kNoIndex ? height[j] : height[i];
        };
        const double dx = at(i + 1, x + 1 < side) - at(i - 1, x > 0);
        const double dy = at(i + side, y + 1 < side) - at(i - side, y > 0);
        const Vec3d n = normalized(Vec3d{-dx, dy, 2 * texel_size});
        put(out, i, Vec3d{0.5, 0.5, 0.5} + n * 0.5);
      }
  });
}

// Object units per texel, over the whole atlas.
double size_of_texel(const ScanMesh& scan, std::uint32_t side) {
  double area = 0, texels = 0;
  for (std::uint32_t t = 0; t < scan.mesh.triangles.size(); ++t) {
    const TriangleInAtlas a = in_atlas(scan.mesh, t, side);
    texels += std::fabs(cross(a.corner[1] - a.corner[0], a.corner[2] - a.corner[0]));
    const Vec3d p = scan.surface[scan.mesh.position_of(t, 0)];
    area += length(
        cross(scan.surface[scan.mesh.position_of(t, 1)] - p, scan.surface[scan.mesh.position_of(t, 2)] - p));
  }
  return std::sqrt(area / std::max(1.0, texels));
}

}  // namespace

ScanTextures paint_atlas(const ScanShape& shape, const ScanMesh& scan, const ScanOptions& options,
                         const RunContext& context) {
  const auto side = static_cast<std::uint32_t>(options.texture_px);
  const auto seed = static_cast<std::uint32_t>(options.seed) * 31u + 3u;
  const double texel = size_of_texel(scan, side);
  const std::vector<std::uint32_t> owner = texel_triangles(scan.mesh, side, 2);
  ScanTextures out;
  out.base_colour = blank(side, side);
  std::vector<float> height;
  if (options.all_textures) {
    out.normal = blank(side, side);
    out.orm = blank(side, side);
    height.resize(owner.size());
  }
  parallel_for(context, side, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y)
      for (std::uint32_t x = 0; x < side; ++x) {
        const std::size_t i = y * side + x;
        const std::uint32_t t = owner[i];
        if (t == kNoIndex) continue;
        Vec3d b = barycentric(in_atlas(scan.mesh, t, side), {x + 0.5, static_cast<double>(y) + 0.5});
        for (int k = 0; k < 3; ++k)
          b[k] = std::clamp(b[k], -1.0, 2.0);  // slivers at a rim extrapolate wildly
        Vec3d position, normal;
        for (int k = 0; k < 3; ++k) {
          position = position + scan.surface[scan.mesh.position_of(t, k)] * b[k];
          normal = normal + scan.normal[scan.mesh.position_of(t, k)] * b[k];
        }
        const ShapeSample s = shape.sample(position, normalized(normal), texel);
        put(out.base_colour, i,
            through_camera(s.colour, scan.chart[t], x, static_cast<std::uint32_t>(y), seed));
        if (!options.all_textures) continue;
        height[i] = static_cast<float>(s.height);
        put(out.orm, i, {s.occlusion, s.roughness, 0});
      }
  });
  if (options.all_textures) derive_normals(height, owner, texel, out.normal, context);
  return out;
}

namespace {

/// So many times as large, bilinear, with a camera's grain where something was painted.
Pixels enlarged(const Pixels& small, std::uint32_t times, std::uint32_t seed, const RunContext& context) {
  Pixels out = blank(small.width_px * times, small.height_px * times);
  const auto cell = [times](std::uint32_t at, std::uint32_t side) {
    const double p = std::clamp((at + 0.5) / times - 0.5, 0.0, side - 1.0);
    const auto first = std::min(static_cast<std::uint32_t>(p), side > 1 ? side - 2 : 0);
    return std::pair(first, p - first);
  };
  parallel_for(context, out.height_px, 16, [&](std::size_t begin, std::size_t end) {
    for (auto y = static_cast<std::uint32_t>(begin); y < end; ++y)
      for (std::uint32_t x = 0; x < out.width_px; ++x) {
        const auto [u, s] = cell(x, small.width_px);
        const auto [v, t] = cell(y, small.height_px);
        const std::uint8_t *a = small.at(u, v), *b = small.at(std::min(u + 1, small.width_px - 1), v);
        const std::uint32_t below = std::min(v + 1, small.height_px - 1);
        const std::uint8_t *c = small.at(u, below), *d = small.at(std::min(u + 1, small.width_px - 1), below);
        const double grain = hash01(x, y, 3, seed) + hash01(x, y, 4, seed) - 1;
        Vec3d colour;
        for (int k = 0; k < 3; ++k)
          colour[k] = mix(mix(1.0 * a[k], 1.0 * b[k], s), mix(1.0 * c[k], 1.0 * d[k], s), t) / 255;
        if (colour == Vec3d{}) continue;
        for (int k = 0; k < 3; ++k) colour[k] += 0.014 * grain;
        put(out, std::size_t{y} * out.width_px + x, colour);
      }
  });
  return out;
}

/// What the mesh's atlas and the textures are made for before they are enlarged.
ScanOptions as_painted(ScanOptions options) {
  if (options.texture_px % options.enlarge != 0)
    throw InputError("make_scan", "--enlarge", "a divisor of --texture", std::to_string(options.enlarge));
  options.texture_px /= options.enlarge;
  return options;
}

ScanTextures painted_textures(const ScanShape& shape, const ScanMesh& scan, const ScanOptions& options,
                              const RunContext& context) {
  ScanTextures out = paint_atlas(shape, scan, options, context);
  if (options.enlarge == 1) return out;
  for (Pixels* pixels : {&out.base_colour, &out.normal, &out.orm})
    if (!pixels->data.empty())
      *pixels = enlarged(*pixels, static_cast<std::uint32_t>(options.enlarge),
                         static_cast<std::uint32_t>(options.seed), context);
  return out;
}

}  // namespace

std::vector<std::uint8_t> encode_scan_jpeg(const Pixels& pixels, int quality) {
  jpeg_compress_struct cinfo;
  jpeg_error_mgr errors;
  // The default handler ends the program, which suits an example's own pixels.
  cinfo.err = jpeg_std_error(&errors);
  jpeg_create_compress(&cinfo);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&cinfo, &bytes, &size);
  cinfo.image_width = pixels.width_px;
  cinfo.image_height = pixels.height_px;
  cinfo.input_components = 3;
  cinfo.in_color_space = JCS_RGB;
  jpeg_set_defaults(&cinfo);
  jpeg_set_quality(&cinfo, quality, TRUE);
  cinfo.dct_method = JDCT_ISLOW;
  jpeg_start_compress(&cinfo, TRUE);
  while (cinfo.next_scanline < cinfo.image_height) {
    auto* row = const_cast<JSAMPROW>(pixels.at(0, cinfo.next_scanline));
    jpeg_write_scanlines(&cinfo, &row, 1);
  }
  jpeg_finish_compress(&cinfo);
  std::vector<std::uint8_t> out(bytes, bytes + size);
  jpeg_destroy_compress(&cinfo);
  std::free(bytes);
  return out;
}

Model make_scan(const ScanOptions& asked, const RunContext& context) {
  const ScanOptions options = as_painted(asked);
  const auto object_seed = static_cast<std::uint32_t>(options.seed);
  const std::unique_ptr<ScanShape> made =
      options.form == ScanForm::kOwl ? make_owl(object_seed) : std::make_unique<RockShape>(object_seed);
  const ScanShape& shape = *made;
  ScanMesh scan = make_scan_mesh(shape, options);
  Model model;
  Material material;
  material.name = "surface";
  material.metallic = 0;
  material.roughness = options.all_textures ? 1.f : 0.8f;
  auto add = [&](const Pixels& pixels, const std::string& name) {
    Image image;
    image.name = name;
    image.format = ImageFormat::kJpeg;
    image.width_px = pixels.width_px;
    image.height_px = pixels.height_px;
    image.channels = 3;
    image.bits_per_channel = 8;
    image.bytes = encode_scan_jpeg(pixels, options.jpeg_quality);
    model.images.push_back(std::move(image));
    TextureRef ref;
    ref.image = static_cast<std::int32_t>(model.images.size()) - 1;
    return ref;
  };
  if (options.texture_px > 0) {
    const ScanTextures textures = painted_textures(shape, scan, options, context);
    material.base_colour_texture = add(textures.base_colour, "base_colour");
    if (options.all_textures) {
      material.normal_texture = add(textures.normal, "normal");
      material.metallic_roughness_texture = material.occlusion_texture = add(textures.orm, "orm");
    }
  } else {
    scan.mesh.uv0.clear();
    for (std::uint32_t p : scan.mesh.wedge_position) {
      const Vec3d c = shape.sample(scan.surface[p], scan.normal[p], 0.001).colour;
      auto linear = [](double x) {
        return static_cast<float>(portable::pow(std::max(1e-6, clamp01(x)), 2.2));
      };
      scan.mesh.colours.push_back({linear(c.x), linear(c.y), linear(c.z), 1});
    }
  }
  model.mesh = std::move(scan.mesh);
  model.materials.push_back(std::move(material));
  return model;
}

MadeRangeScan make_range_scan(const ScanOptions& options, const RunContext& context) {
  const RockShape shape(static_cast<std::uint32_t>(options.seed));
  const auto seed = static_cast<std::uint32_t>(options.seed) * 127u + 1u;
  MadeRangeScan scan;
  scan.columns = static_cast<std::uint32_t>(options.range_columns);
  scan.rows = static_cast<std::uint32_t>(options.range_rows);
  scan.height = RockShape::range_height();
  scan.radius.resize(static_cast<std::size_t>(scan.columns) * scan.rows);
  scan.colour = blank(scan.columns, scan.rows);
  const double deviation = options.noise * 0.35;
  auto at = [&](double column, double row) {
    const double alpha = 2 * portable::kPi * column / scan.columns, t = 1 - row / (scan.rows - 1.0);
    const double r = shape.range_radius(alpha, t);
    return Vec3d{r * portable::sin(alpha), (t - 0.5) * scan.height, r * portable::cos(alpha)};
  };
  auto dropped = [&](std::uint32_t column, std::uint32_t row) {
    for (int h = 0; h < options.holes; ++h) {
      const auto k = static_cast<std::uint32_t>(h);
      const double cx = hash01(k, 1, 0, seed) * scan.columns, cy = hash01(k, 2, 0, seed) * scan.rows;
      const double size = scan.rows * mix(0.02, 0.06, hash01(k, 3, 0, seed));
      double dx = std::fabs(column - cx);
      dx = std::min(dx, scan.columns - dx);
      const double dy = row - cy;
      if (dx * dx + dy * dy < size * size * (1 + 0.6 * noise({column * 0.2, row * 0.2, 0.5}, seed)))
        return true;
    }
    return hash01(column, row, 9, seed) < 0.0005;  // single drop-outs, as on dark or shiny spots
  };
  parallel_for(context, scan.rows, 8, [&](std::size_t begin, std::size_t end) {
    for (auto row = static_cast<std::uint32_t>(begin); row < end; ++row)
      for (std::uint32_t column = 0; column < scan.columns; ++column) {
        const std::size_t i = static_cast<std::size_t>(row) * scan.columns + column;
        const Vec3d p = at(column, row);
        const Vec3d normal = normalized(cross(at(column + 0.5, row) - p, at(column, row - 0.5) - p));
        const double finest = 2 * portable::kPi * 0.07 / scan.columns;
        put(scan.colour, i, through_camera(shape.sample(p, normal, finest).colour, 0, column, row, seed));
        const double white = hash01(column, row, 7, seed) + hash01(column, row, 8, seed) - 1;
        const double r = std::sqrt(p.x * p.x + p.z * p.z) + 2.4 * deviation * white;
        scan.radius[i] = dropped(column, row) ? 0.f : static_cast<float>(r);
      }
  });
  return scan;
}

}  // namespace texmesh
