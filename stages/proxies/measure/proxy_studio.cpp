#include "stages/proxies/measure/proxy_studio.h"

#include <algorithm>
#include <cmath>

#include "format/base/box.h"
#include "stages/image/webp.h"

namespace texmesh::proxies {
namespace {

constexpr int kViews = 4;
// At the largest height, which has 16 of 21 parts of all pixels: two.
constexpr int kLargeStep = 2;

RenderTexture decoded(const ProxyImage& image, bool srgb, const RunContext& context) {
  return render_texture(decode_webp_rgba(image.file), srgb, 0, context);
}

RenderMaterial proxy_material(const MaterialGroup& group, const ProxyPictures& pictures) {
  RenderMaterial out;
  const auto use = [&](TextureUse slot, std::int32_t texture) {
    out.slot(slot).texture = texture;
    out.slot(slot).wrap_s = out.slot(slot).wrap_t = Wrap::kClamp;
  };
  out.unlit = group.unlit, out.double_sided = group.double_sided, out.alpha_mode = group.alpha_mode;
  out.metallic = pictures.metallic, out.roughness = pictures.roughness;
  std::int32_t next = 0;
  use(TextureUse::kBaseColour, next++);
  if (pictures.orm) {
    out.metallic = out.roughness = 1;
    use(TextureUse::kMetallicRoughness, next);
    use(TextureUse::kOcclusion, next++);
  }
  if (pictures.normal) use(TextureUse::kNormal, next++);
  if (pictures.emission) {
    out.emissive = pictures.emissive;
    use(TextureUse::kEmissive, next++);
  }
  return out;
}

}  // namespace

ShownModel shown_proxy(const AtlasMesh& mesh, const RoundedMesh& rounded,
                       const std::vector<MaterialGroup>& groups, const ProxyPictures& pictures) {
  ShownModel out;
  RunContext context;
  out.mesh.positions = rounded.positions;
  out.mesh.normals = rounded.normals;
  out.mesh.uv0 = rounded.uvs;
  for (std::uint32_t v = 0; v < rounded.positions.size(); ++v) out.mesh.wedge_position.push_back(v);
  out.mesh.triangles = mesh.triangles;
  for (const std::uint32_t g : mesh.group_of)
    out.mesh.triangle_material.push_back(static_cast<std::uint16_t>(g));
  out.mesh.triangle_part.assign(mesh.triangles.size(), 0);
  out.mesh.part_names = {""};
  for (const MaterialGroup& g : groups) out.shown.materials.push_back(proxy_material(g, pictures));
  out.shown.textures.push_back(decoded(pictures.base_colour, true, context));
  if (pictures.orm) out.shown.textures.push_back(decoded(*pictures.orm, false, context));
  if (pictures.normal) out.shown.textures.push_back(decoded(*pictures.normal, false, context));
  if (pictures.emission) out.shown.textures.push_back(decoded(*pictures.emission, true, context));
  return out;
}

ProxyStudio::ProxyStudio(const Mesh& mesh, const ShownMaterials& shown)
    : mesh_(mesh), shown_(shown), environment_(studio_environment()) {}

const std::vector<ProxyStudio::View>& ProxyStudio::views(std::size_t size, const RunContext& context) {
  std::vector<View>& views = views_[size];
  if (!views.empty()) return views;
  const double extent = to_double(bounding_box(mesh_.positions)).longest_side();
  const BoundingSphere sphere = bounding_sphere(mesh_.positions);
  const RenderScene scene = render_scene(mesh_, shown_.materials, shown_.textures.size());
  for (int v = 0; v < kViews; v += size == kLarge ? kLargeStep : 1) {
    context.check_cancelled();
    View view;
    view.camera = perspective_camera(camera_of(v, kViews, sphere.centre, sphere.radius));
    const double distance = length(view.camera.eye - sphere.centre);
    const double side = kDisplayedPx[size] * 2 * distance * view.camera.tan_half_fov / extent;
    view.side_px = static_cast<std::uint32_t>(std::clamp(std::ceil(side), 1.0, 8192.0));
    view.camera.tan_half_fov *= view.side_px / std::clamp(side, 0.5, 8192.0);
    const Picture picture =
        shade(scene, look(scene, view.camera, view.side_px, context), shown_.textures, environment_, context);
    view.reference = prepare_flip(picture);  // what was seen is gone by now
    views.push_back(std::move(view));
  }
  return views;
}

FlipSum ProxyStudio::compare(const RenderScene& scene, const std::vector<RenderTexture>& textures,
                             std::size_t size, const RunContext& context, double hopeless) {
  FlipSum sum;
  const std::vector<View>& all = views(size, context);
  for (std::size_t v = 0; v < all.size(); ++v) {
    if (2 * v >= all.size() && sum.mean() > hopeless) break;
    const View& view = all[v];
    const Picture picture =
        shade(scene, look(scene, view.camera, view.side_px, context), textures, environment_, context);
    sum.add(compare_flip(view.reference, prepare_flip(picture)));
  }
  return sum;
}

FlipSum ProxyStudio::at_middle(const ShownModel& model, const RunContext& context, double hopeless) {
  const RenderScene scene = render_scene(model.mesh, model.shown.materials, model.shown.textures.size());
  return compare(scene, model.shown.textures, kMiddle, context, hopeless);
}

std::vector<ProxyPictureLoss> ProxyStudio::losses(const ShownModel& model, const FlipSum& middle,
                                                  const RunContext& context) {
  std::vector<ProxyPictureLoss> out;
  const RenderScene scene = render_scene(model.mesh, model.shown.materials, model.shown.textures.size());
  for (std::size_t size = 0; size < kDisplayedPx.size(); ++size) {
    const FlipSum flip = size == kMiddle ? middle : compare(scene, model.shown.textures, size, context);
    out.push_back({kDisplayedPx[size], flip.mean(), flip.percentile(0.95)});
  }
  return out;
}

}  // namespace texmesh::proxies
