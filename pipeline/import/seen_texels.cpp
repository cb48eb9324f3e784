#include "pipeline/import/seen_texels.h"

#include <cmath>

#include "pipeline/import/text_scan.h"
#include "stages/geometry/texel_coverage.h"
#include "stages/image/decode_image.h"

namespace texmesh {
namespace {

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

std::vector<bool> seen_texels(const Model& model, std::size_t material, const TextureRef& texture,
                              std::uint32_t width_px, std::uint32_t height_px, const RunContext& context) {
  std::vector<std::uint32_t> triangles;
  for (std::uint32_t t = 0; t < model.mesh.triangles.size() && !uvs_of(model, texture).empty(); ++t)
    if (model.mesh.triangle_material[t] == material) triangles.push_back(t);
  const SeenTexels seen = texels_of(model, triangles, texture, width_px, height_px, context);
  std::vector<bool> out(std::size_t{width_px} * height_px);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = seen.at(i);
  if (std::find(out.begin(), out.end(), true) == out.end()) out.assign(out.size(), true);
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
