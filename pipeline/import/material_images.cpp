#include "pipeline/import/material_images.h"

#include "pipeline/import/text_scan.h"
#include "stages/base/float_math.h"
#include "stages/geometry/texel_coverage.h"
#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"

namespace texmesh {

namespace {

struct ImageTexel {
  const std::uint8_t* channel = nullptr;
  std::uint32_t channels = 0;  // 1 grey, 2 grey + alpha, 3 RGB, 4 RGBA
};

/// An image of the model; for -1 one white texel.
struct Plane {
  Pixels pixels{1, 1, 1, {255}};
  std::string name;

  Plane(Model& model, std::int32_t index, FloatEncoding encoding) {
    if (index < 0) return;
    const Image& image = model.images.at(static_cast<std::size_t>(index));
    std::string damage;
    pixels = decode_image(image, encoding, &damage);
    name = image.name;
    if (!damage.empty()) add_warning(model.notes, "damaged-image", name, damage_words(damage));
  }
  /// The texel nearest to (x, y) of a picture of the given size.
  ImageTexel at(std::uint32_t x, std::uint32_t y, std::uint32_t width, std::uint32_t height) const {
    return {pixels.at(static_cast<std::uint32_t>(std::uint64_t{x} * pixels.width_px / width),
                      static_cast<std::uint32_t>(std::uint64_t{y} * pixels.height_px / height)),
            pixels.channels};
  }
};

/// `texel(a, b, to)` writes `channels` bytes from those of both images at one place.
template <class Texel>
std::int32_t combine(Model& model, const Plane& a, const Plane& b, std::uint32_t channels,
                     const Texel& texel) {
  Pixels out{std::max(a.pixels.width_px, b.pixels.width_px),
             std::max(a.pixels.height_px, b.pixels.height_px),
             channels,
             {}};
  out.data.resize(std::size_t{out.width_px} * out.height_px * channels);
  std::uint8_t* to = out.data.data();
  for (std::uint32_t y = 0; y < out.height_px; ++y)
    for (std::uint32_t x = 0; x < out.width_px; ++x, to += channels)
      texel(a.at(x, y, out.width_px, out.height_px), b.at(x, y, out.width_px, out.height_px), to);
  const std::string name = a.name + (a.name.empty() || b.name.empty() ? "" : " + ") + b.name;
  std::vector<std::uint8_t> png = write_png(out);
  for (std::size_t i = 0; i < model.images.size(); ++i)  // several materials may want the same
    if (model.images[i].bytes == png) return static_cast<std::int32_t>(i);
  ImageLimits limits;
  limits.max_pixels = ~0ull;  // of images that were within theirs
  model.images.push_back(probe_image(name, std::move(png), limits));
  return static_cast<std::int32_t>(model.images.size() - 1);
}

/// The texels whose centres triangles show.
class SeenTexels {
 public:
  SeenTexels(std::uint32_t width_px, std::uint32_t height_px, const TextureRef& reference)
      : width_(width_px),
        height_(height_px),
        reference_(reference),
        seen_(std::size_t{width_px} * height_px) {}

  void add(const std::array<Vec2d, 3>& t) {
    double lo = t[0].y, hi = t[0].y;
    bool far = false;
    for (const Vec2d& p : t) {
      lo = std::min(lo, p.y), hi = std::max(hi, p.y);
      far = far || !(std::fabs(p.x) < kFar) || !(std::fabs(p.y) < kFar);
    }
    // Tiles upon tiles: every texel is seen, or it takes too long to find out.
    all_ = all_ || far || hi - lo > 4.0 * height_ || work_ > 16 * seen_.size();
    if (all_) return;
    for (auto row = static_cast<std::int64_t>(std::ceil(lo - 0.5)); static_cast<double>(row) + 0.5 <= hi;
         ++row)
      add_row(t, row);
  }
  bool all() const { return all_; }
  bool at(std::size_t texel) const { return all_ || seen_[texel]; }

 private:
  static constexpr double kFar = 1e9;

  void add_row(const std::array<Vec2d, 3>& t, std::int64_t row) {
    const double y = static_cast<double>(row) + 0.5;
    double lo = INFINITY, hi = -INFINITY;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2d &a = t[k], &b = t[(k + 1) % 3];
      if ((a.y < y && b.y < y) || (a.y > y && b.y > y)) continue;
      const double share = a.y == b.y ? 0 : (y - a.y) / (b.y - a.y);
      for (const double x : {a.x + share * (b.x - a.x), a.y == b.y ? b.x : a.x + share * (b.x - a.x)})
        lo = std::min(lo, x), hi = std::max(hi, x);
    }
    if (hi - lo > 4.0 * width_) all_ = true;
    if (all_ || !(lo <= hi)) return;
    const std::size_t line = std::size_t{wrapped(row, height_, reference_.wrap_t)} * width_;
    for (auto x = static_cast<std::int64_t>(std::ceil(lo - 0.5)); static_cast<double>(x) + 0.5 <= hi;
         ++x, ++work_)
      seen_[line + wrapped(x, width_, reference_.wrap_s)] = true;
  }

  std::uint32_t width_, height_;
  const TextureRef& reference_;
  std::vector<bool> seen_;
  std::uint64_t work_ = 0;
  bool all_ = false;
};

const std::vector<Vec2f>& uvs_of(const Model& model, const TextureRef& reference) {
  return reference.texcoord == 0 ? model.mesh.uv0 : model.mesh.uv1;
}

SeenTexels texels_of(const Model& model, const std::vector<std::uint32_t>& triangles,
                     const TextureRef& reference, std::uint32_t width_px, std::uint32_t height_px,
                     const RunContext& context) {
  const std::vector<Vec2f>& uvs = uvs_of(model, reference);
  const TexelMap place(reference.transform, width_px, height_px);
  SeenTexels seen(width_px, height_px, reference);
  for (std::size_t k = 0; k < triangles.size() && !seen.all(); ++k) {
    if (k % 65536 == 0) context.check_cancelled();
    const Triangle& t = model.mesh.triangles[triangles[k]];
    seen.add({place(uvs[t[0]]), place(uvs[t[1]]), place(uvs[t[2]])});
  }
  return seen;
}

bool is_opaque(const Pixels& pixels) {
  for (std::size_t i = pixels.channels - 1; i < pixels.data.size(); i += pixels.channels)
    if (pixels.data[i] < 250) return false;
  return true;
}

/// Calls judge(material, pixels, seen) for each of `asked` that has such a texture and coordinates for it; a
/// picture is decoded once, and left out where !counts(pixels).
template <class Counts, class F>
void for_each_seen(const Model& model, const std::vector<std::size_t>& asked, TextureRef Material::*texture,
                   const RunContext& context, Counts&& counts, F&& judge) {
  std::vector<std::vector<std::size_t>> materials_of(model.images.size());
  std::vector<std::vector<std::uint32_t>> triangles_of(model.materials.size());
  std::vector<bool> is_asked(model.materials.size());
  for (const std::size_t m : asked) {
    const TextureRef& reference = model.materials[m].*texture;
    if (!reference.used() || uvs_of(model, reference).empty()) continue;
    materials_of[static_cast<std::size_t>(reference.image)].push_back(m);
    is_asked[m] = true;
  }
  for (std::uint32_t t = 0; t < model.mesh.triangles.size(); ++t)
    if (is_asked[model.mesh.triangle_material[t]]) triangles_of[model.mesh.triangle_material[t]].push_back(t);
  for (std::size_t i = 0; i < model.images.size(); ++i) {
    if (materials_of[i].empty()) continue;
    const Pixels pixels = decode_image(model.images[i]);
    if (!counts(pixels)) continue;
    for (const std::size_t m : materials_of[i]) {
      const SeenTexels seen = texels_of(model, triangles_of[m], model.materials[m].*texture, pixels.width_px,
                                        pixels.height_px, context);
      judge(m, pixels, seen);
    }
  }
}

/// Tangent-space normals point outwards: z (blue) is high nearly everywhere, x and y average to the middle.
bool shows_normals(const Pixels& pixels, const SeenTexels& seen) {
  if (pixels.channels < 3) return false;
  std::uint64_t n = 0, blue = 0, sum[3] = {0, 0, 0};
  const std::uint8_t* p = pixels.data.data();
  for (std::size_t i = 0; i < std::size_t{pixels.width_px} * pixels.height_px; ++i, p += pixels.channels) {
    if (!seen.at(i)) continue;
    ++n;
    for (int c = 0; c < 3; ++c) sum[c] += p[c];
    blue += p[2] >= 128 && p[2] >= p[0] && p[2] >= p[1];
  }
  const auto near_middle = [n](std::uint64_t s) { return s >= 88 * n && s <= 168 * n; };
  return blue * 10 >= n * 8 && near_middle(sum[0]) && near_middle(sum[1]) && sum[2] >= 160 * n;
}

}  // namespace

std::int32_t combine_alpha(Model& model, std::int32_t colour, std::int32_t alpha) {
  const Plane a(model, colour, FloatEncoding::kSrgb), b(model, alpha, FloatEncoding::kAsIs);
  const std::uint32_t last = b.pixels.channels - 1;
  bool own_alpha = false;  // of the second image: not all opaque
  for (std::size_t i = last; b.pixels.channels % 2 == 0 && i < b.pixels.data.size(); i += b.pixels.channels)
    own_alpha = own_alpha || b.pixels.data[i] != 255;
  const std::uint32_t from = own_alpha ? last : 0, step = a.pixels.channels >= 3 ? 1 : 0;
  return combine(model, a, b, 4, [&](const ImageTexel& c, const ImageTexel& o, std::uint8_t* to) {
    for (std::uint32_t k = 0; k < 3; ++k) to[k] = c.channel[k * step];
    to[3] = o.channel[from];
  });
}

std::int32_t combine_roughness_metallic(Model& model, std::int32_t roughness, std::int32_t metallic) {
  const Plane a(model, roughness, FloatEncoding::kAsIs), b(model, metallic, FloatEncoding::kAsIs);
  return combine(model, a, b, 3, [](const ImageTexel& r, const ImageTexel& m, std::uint8_t* to) {
    to[0] = 255;  // occlusion: none
    to[1] = r.channel[0];
    to[2] = m.channel[0];
  });
}

namespace {

constexpr float kDielectric = 0.04f;  // of light from straight ahead
constexpr float kNearZero = 1e-6f;

float brightness(Vec3f c) { return std::sqrt(0.299f * c.x * c.x + 0.587f * c.y * c.y + 0.114f * c.z * c.z); }

float unit(float v) { return std::clamp(v, 0.0f, 1.0f); }

/// The root of the equation that both models' diffuse and specular light set for the metal's share.
float metallic_of(float diffuse, float specular, float not_specular) {
  if (specular < kDielectric) return 0;
  const float a = kDielectric, b = diffuse * not_specular / (1 - a) + specular - 2 * a, c = a - specular;
  return unit((-b + std::sqrt(std::max(b * b - 4 * a * c, 0.0f))) / (2 * a));
}

/// Light of texels with one or three colours; alpha is 1 where there is none.
struct Texel {
  Vec3f light;
  float alpha = 1;
};
Texel texel_of(const std::uint8_t* t, std::uint32_t channels) {
  const std::array<float, 256>& light = light_of_bytes();
  const std::uint32_t step = channels >= 3 ? 1 : 0;
  return {{light[t[0]], light[t[step]], light[t[2 * step]]},
          channels % 2 == 0 ? static_cast<float>(t[channels - 1]) / 255 : 1};
}

Vec3f product(Vec3f a, Vec3f b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }

std::uint8_t byte_of(float v) { return static_cast<std::uint8_t>(unit(v) * 255 + 0.5f); }

MetallicRoughness converted(const Texel& diffuse, const Texel& specular, const SpecularGlossiness& factors) {
  return metallic_roughness_of({product(diffuse.light, factors.diffuse),
                                product(specular.light, factors.specular),
                                specular.alpha * factors.glossiness});
}

}  // namespace

MetallicRoughness metallic_roughness_of(const SpecularGlossiness& point) {
  const Vec3f d = point.diffuse, s = point.specular;
  const float not_specular = 1 - std::max({s.x, s.y, s.z});
  MetallicRoughness out;
  out.roughness = 1 - point.glossiness;
  out.metallic = metallic_of(brightness(d), brightness(s), not_specular);
  const float share = out.metallic * out.metallic;
  const float of_diffuse = not_specular / (1 - kDielectric) / std::max(1 - out.metallic, kNearZero);
  const float reflected = kDielectric * (1 - out.metallic), of_metal = 1 / std::max(out.metallic, kNearZero);
  for (int k = 0; k < 3; ++k)
    out.base_colour[k] =
        unit((1 - share) * unit(d[k] * of_diffuse) + share * unit((s[k] - reflected) * of_metal));
  return out;
}

MetallicRoughnessImages convert_specular_glossiness(Model& model, const SpecularGlossinessImages& images,
                                                    const SpecularGlossiness& factors) {
  static const SampledCurve<4096> encode(srgb_of_light);
  const Plane a(model, images.diffuse, FloatEncoding::kSrgb), b(model, images.specular, FloatEncoding::kSrgb);
  const auto combined = [&](std::uint32_t channels, auto&& texel) {
    return combine(model, a, b, channels, [&](const ImageTexel& d, const ImageTexel& s, std::uint8_t* to) {
      const Texel diffuse = texel_of(d.channel, d.channels), specular = texel_of(s.channel, s.channels);
      texel(diffuse, converted(diffuse, specular, factors), to);
    });
  };
  MetallicRoughnessImages out;
  out.base_colour = combined(4, [](const Texel& diffuse, const MetallicRoughness& m, std::uint8_t* to) {
    for (int k = 0; k < 3; ++k) to[k] = byte_of(encode(m.base_colour[k]));
    to[3] = byte_of(diffuse.alpha);
  });
  out.metallic_roughness = combined(3, [](const Texel&, const MetallicRoughness& m, std::uint8_t* to) {
    to[0] = 255;  // occlusion: none
    to[1] = byte_of(m.roughness);
    to[2] = byte_of(m.metallic);
  });
  return out;
}

SpecularGlossiness mean_of_specular(const Model& model, const TextureRef& texture, std::size_t material,
                                    const SpecularGlossiness& factors, const RunContext& context) {
  const Pixels pixels =
      decode_image(model.images.at(static_cast<std::size_t>(texture.image)), FloatEncoding::kSrgb);
  std::vector<std::uint32_t> triangles;
  for (std::uint32_t t = 0; t < model.mesh.triangles.size() && !uvs_of(model, texture).empty(); ++t)
    if (model.mesh.triangle_material[t] == material) triangles.push_back(t);
  const SeenTexels seen = texels_of(model, triangles, texture, pixels.width_px, pixels.height_px, context);
  double sum[4] = {0, 0, 0, 0}, count = 0;
  const auto add = [&](auto&& counts) {
    for (std::size_t i = 0; i < std::size_t{pixels.width_px} * pixels.height_px; ++i) {
      if (!counts(i)) continue;
      const Texel t = texel_of(&pixels.data[i * pixels.channels], pixels.channels);
      for (int k = 0; k < 3; ++k) sum[k] += static_cast<double>(t.light[k]);
      sum[3] += static_cast<double>(t.alpha);
      ++count;
    }
  };
  add([&](std::size_t i) { return seen.at(i); });
  if (count == 0) add([](std::size_t) { return true; });  // no triangle shows one, or has such coordinates
  SpecularGlossiness out = factors;
  for (int k = 0; k < 3; ++k) out.specular[k] *= static_cast<float>(sum[k] / count);
  out.glossiness *= static_cast<float>(sum[3] / count);
  return out;
}

void judge_alpha(Model& model, const RunContext& context) {
  std::vector<std::size_t> asked;
  for (std::size_t m = 0; m < model.materials.size(); ++m) {
    const Material& material = model.materials[m];
    const std::int32_t image = material.base_colour_texture.image;
    if (material.alpha_mode == AlphaMode::kOpaque && image >= 0 &&
        model.images[static_cast<std::size_t>(image)].channels % 2 == 0)
      asked.push_back(m);
  }
  for_each_seen(
      model, asked, &Material::base_colour_texture, context,
      [](const Pixels& pixels) { return !is_opaque(pixels); },
      [&](std::size_t material, const Pixels& pixels, const SeenTexels& seen) {
        Material& m = model.materials[material];
        std::uint64_t n = 0, opaque = 0, between = 0;
        const std::uint8_t* alpha = pixels.data.data() + pixels.channels - 1;
        for (std::size_t i = 0; i < std::size_t{pixels.width_px} * pixels.height_px;
             ++i, alpha += pixels.channels) {
          if (!seen.at(i)) continue;
          ++n;
          opaque += *alpha >= 250;
          between += *alpha > 10 && *alpha < 250;
        }
        if (opaque == n) return;
        if (opaque + between == 0)
          return add_warning(model.notes, "alpha-hides-all", m.name,
                             "the picture's alpha would hide all that it lies on; the material stays opaque");
        m.alpha_mode = between * 20 <= n ? AlphaMode::kMask : AlphaMode::kBlend;
      });
}

void judge_bump_maps(Model& model, const std::vector<std::size_t>& materials, const RunContext& context) {
  for_each_seen(
      model, materials, &Material::normal_texture, context, [](const Pixels&) { return true; },
      [&](std::size_t material, const Pixels& pixels, const SeenTexels& seen) {
        if (shows_normals(pixels, seen)) return;
        Material& m = model.materials[material];
        add_info(model.notes, "height-map", "material " + quote(m.name),
                 model.images[static_cast<std::size_t>(m.normal_texture.image)].name +
                     " is no normal map; height maps are not shown");
        m.normal_texture = {};
        m.normal_scale = 1;
      });
}

}  // namespace texmesh
