#include "pipeline/import/seen_texels.h"

#include <cmath>

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

bool is_opaque(const Pixels& pixels) {
  for (std::size_t i = pixels.channels - 1; i < pixels.data.size(); i += pixels.channels)
    if (pixels.data[i] < 250) return false;
  return true;
}

void judge(Model& model, std::size_t material, const std::vector<std::uint32_t>& triangles,
           const Pixels& pixels, const RunContext& context) {
  Material& m = model.materials[material];
  const TextureRef& reference = m.base_colour_texture;
  const std::vector<Vec2f>& uvs = reference.texcoord == 0 ? model.mesh.uv0 : model.mesh.uv1;
  if (uvs.empty()) return;
  const TexelMap texels_of(reference.transform, pixels.width_px, pixels.height_px);
  SeenTexels seen(pixels.width_px, pixels.height_px, reference);
  for (std::size_t i = 0; i < triangles.size() && !seen.all(); ++i) {
    if (i % 65536 == 0) context.check_cancelled();
    const Triangle& t = model.mesh.triangles[triangles[i]];
    seen.add({texels_of(uvs[t[0]]), texels_of(uvs[t[1]]), texels_of(uvs[t[2]])});
  }
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
}

}  // namespace

void judge_alpha(Model& model, const RunContext& context) {
  std::vector<std::vector<std::size_t>> materials_of(model.images.size());
  std::vector<std::vector<std::uint32_t>> triangles_of(model.materials.size());
  std::vector<bool> asked(model.materials.size());
  for (std::size_t m = 0; m < model.materials.size(); ++m) {
    const Material& material = model.materials[m];
    if (material.alpha_mode != AlphaMode::kOpaque || !material.base_colour_texture.used()) continue;
    const auto image = static_cast<std::size_t>(material.base_colour_texture.image);
    if (model.images[image].channels % 2 != 0) continue;
    materials_of[image].push_back(m);
    asked[m] = true;
  }
  for (std::uint32_t t = 0; t < model.mesh.triangles.size(); ++t)
    if (asked[model.mesh.triangle_material[t]]) triangles_of[model.mesh.triangle_material[t]].push_back(t);
  for (std::size_t i = 0; i < model.images.size(); ++i) {
    if (materials_of[i].empty()) continue;
    const Pixels pixels = decode_image(model.images[i]);
    if (is_opaque(pixels)) continue;
    for (const std::size_t m : materials_of[i]) judge(model, m, triangles_of[m], pixels, context);
  }
}

}  // namespace texmesh
