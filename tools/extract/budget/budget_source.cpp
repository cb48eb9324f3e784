#include "tools/extract/budget/budget_source.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "format/base/errors.h"
#include "format/container/layout.h"
#include "tools/extract/glb/scale_file.h"

namespace texmesh {
namespace {

constexpr int kViews = 5;
constexpr double kTexelsPerByte = 40;  // more texels than that are never worth a byte
constexpr std::uint32_t kLeastSide = 4;
constexpr double kWholeBlocks = 16;
constexpr int kWindowsPerView = 1;
constexpr std::uint32_t kWindowPx = 80;
constexpr double kFinestShown = 12;  // texels per pixel: pictures hardly read finer ones

double most_texels(std::uint64_t bytes) {
  return std::max(kTexelsPerByte * static_cast<double>(bytes), 65536.0);
}

double longest_side(const Mesh& mesh) {
  const double side = to_double(bounding_box(mesh.positions)).longest_side();
  return side > 0 ? side : 1;
}

BoundingSphere sphere_of(const Mesh& mesh) {
  if (mesh.positions.empty()) throw StageError("extract", "S_0", "positions", "none");
  const BoundingSphere sphere = bounding_sphere(mesh.positions);
  if (!(sphere.radius > 0)) throw StageError("extract", "S_0", "an extent above 0", "one point");
  return sphere;
}

}  // namespace

BudgetSource::BudgetSource(PackageReader& from, const ExtractRequest& wishes, const RunContext& run)
    : package(from),
      request(wishes),
      context(run),
      display_px(wishes.display_px > 0 ? wishes.display_px : kBudgetDisplayPx),
      side_px(static_cast<std::uint32_t>(std::clamp(display_px, 64.0, 768.0))),
      textures(from, most_texels(wishes.bytes), run) {
  context.progress = nullptr;
  source = read_model(scale_file(package, 0, context), mesh_path(0), context);
  const BoundingSphere sphere = sphere_of(source.mesh);
  light = normal_samples(source.mesh);
  extent = longest_side(source.mesh);
  cameras = cameras_around(sphere, kViews, side_px);
  find_textures();
  find_groups();
  finest = lit_mesh(source);
  {
    const LitViews views(finest, cameras, context);
    measure_surface(views);
    windows = side_px < 2 * kWindowPx ? cameras : windows_of(views, kWindowsPerView, kWindowPx);
  }
  read_best_textures();
  environment = studio_environment();
  finest_windows = std::make_unique<LitViews>(finest, windows, context);
  window_meter = std::make_unique<LitMeter>(*finest_windows, best_textures, environment, context);
}

bool BudgetSource::serves(std::uint64_t bytes) const { return textures.serves(most_texels(bytes)); }

std::int32_t BudgetSource::shown_texture(const Model& model, const TextureRef& reference,
                                         TextureUse use) const {
  const std::vector<Vec2f>& uv = reference.texcoord == 0 ? model.mesh.uv0 : model.mesh.uv1;
  if (!reference.used() || reference.texcoord > 1 || uv.empty()) return -1;
  const std::string& name = model.images.at(static_cast<std::size_t>(reference.image)).name;
  for (std::size_t t = 0; t < shown.size(); ++t)
    if (shown[t].srgb == is_srgb(use) && image_name(image(shown[t].image).image) == name)
      return static_cast<std::int32_t>(t);
  return -1;
}

void BudgetSource::find_textures() {
  for (const Material& m : source.materials)
    render_material(m, [&](const TextureRef& reference, TextureUse use) {
      if (reference.texcoord > 1 || shown_texture(source, reference, use) >= 0) return -1;
      for (std::size_t i = 0; i < image_count(); ++i)
        if (image_name(image(i).image) == source.images.at(static_cast<std::size_t>(reference.image)).name)
          shown.push_back({i, is_srgb(use)});
      return -1;
    });
}

/// Images of one material are of one group.
void BudgetSource::find_groups() {
  for (std::size_t i = 0; i < image_count(); ++i) groups.push_back(i);
  for (const Material& m : source.materials) {
    std::vector<std::size_t> together;
    render_material(m, [&](const TextureRef& reference, TextureUse use) {
      const std::int32_t t = shown_texture(source, reference, use);
      if (t >= 0) together.push_back(groups[shown[static_cast<std::size_t>(t)].image]);
      return -1;
    });
    for (std::size_t& g : groups)
      if (std::find(together.begin(), together.end(), g) != together.end()) g = together.front();
  }
}

LitMesh BudgetSource::lit_mesh(Model& model) const {
  LitMesh out;
  out.texture_count = shown.size();
  for (const Material& m : model.materials)
    out.materials.push_back(render_material(m, [&](const TextureRef& reference, TextureUse use) {
      return shown_texture(model, reference, use);
    }));
  out.mesh = std::move(model.mesh);
  return out;
}

/// Texels that S_0 shows over the pixels that its whole surface has on the screen: four times its mean
/// outline, as if it were convex.
void BudgetSource::measure_surface(const LitViews& views) {
  constexpr std::uint32_t kSide = 256;
  double pixels = 0;
  for (std::size_t v = 0; v < views.count(); ++v) pixels += static_cast<double>(views.covered_px(v));
  pixels = std::max(4 * pixels / kViews, 1.0);
  for (std::size_t i = 0; i < image_count(); ++i) {
    double covered = 0;
    for (const std::uint8_t bits : shown_texels(*this, i, kSide, kSide)) covered += std::popcount(bits);
    texels_per_pixel.push_back(covered / (kSide * kSide) * image(i).width_px * image(i).height_px / pixels);
  }
}

void BudgetSource::read_best_textures() {
  for (std::size_t i = 0; i < image_count() && request.images != ExtractImages::kPng; ++i)
    textures.set_shown(i, shown_texels(*this, i, image(i).width_px, image(i).height_px));
  for (const ShownTexture& t : shown) {
    const PackageImage& from = image(t.image);
    double share = 1;  // halves, not sharpened: the source's own smaller copies
    while (texels_per_pixel[t.image] * share * share > kFinestShown) share /= 2;
    best_textures.push_back(render_texture(
        textures.texels(t.image, side_of(from.width_px, share), side_of(from.height_px, share), {}, 0),
        t.srgb, 0, context));
  }
}

const LitMeter& BudgetSource::whole_pictures() {
  if (!meter_)
    meter_ =
        std::make_unique<LitMeter>(LitViews(finest, cameras, context), best_textures, environment, context);
  return *meter_;
}

std::uint32_t side_of(std::uint32_t full, double share) {
  double side = std::floor(static_cast<double>(full) * share + 0.5);
  if (side >= 8 * kWholeBlocks && side < full) side = std::floor(side / kWholeBlocks + 0.5) * kWholeBlocks;
  return static_cast<std::uint32_t>(
      std::clamp(side, std::min<double>(kLeastSide, full), static_cast<double>(full)));
}

std::vector<std::uint8_t> shown_texels(const BudgetSource& source, std::size_t image, std::uint32_t width_px,
                                       std::uint32_t height_px) {
  return shown_texels(source.finest.mesh, source.source, source.image(image).image, width_px, height_px);
}

}  // namespace texmesh
