#include "tools/extract/budget/lit_meter.h"

#include <algorithm>

#include "stages/base/parallel.h"

namespace texmesh {
namespace {

RunContext serial(const RunContext& context) {
  RunContext one = context;
  one.threads = 1;
  return one;
}

bool covered(const Visibility& view, std::size_t pixel) { return view.first[pixel] < view.first[pixel + 1]; }

/// A camera at the same place that looks at a pixel, with pixels of the same size.
LitCamera window_at(const Visibility& view, std::size_t pixel, std::uint32_t side_px) {
  const RenderCamera& from = view.camera;
  const double pitch = 2 * from.tan_half_fov / view.side_px;
  const auto offset = [&](std::size_t place) {
    return (static_cast<double>(place) + 0.5 - 0.5 * view.side_px) * pitch;
  };
  const Vec3d towards =
      from.x * offset(pixel % view.side_px) - from.y * offset(pixel / view.side_px) - from.z;
  LitCamera out{look_at_camera(from.eye, from.eye + towards, from.y, kRenderFovDegrees, from.near), side_px};
  out.camera.tan_half_fov = pitch * 0.5 * side_px;
  return out;
}

using Materials = std::vector<RenderMaterial>;

/// The materials with slots that read other textures: place[t] instead of t, where it is not negative.
Materials with_textures(Materials materials, const std::vector<std::int32_t>& place) {
  for (RenderMaterial& m : materials)
    for (TextureSlot& slot : m.textures) {
      const std::int32_t other = slot.texture < 0 ? -1 : place[static_cast<std::size_t>(slot.texture)];
      if (other >= 0) slot.texture = other;
    }
  return materials;
}

}  // namespace

std::vector<LitCamera> cameras_around(const BoundingSphere& bounds, int count, std::uint32_t side_px) {
  std::vector<LitCamera> out;
  for (int v = 0; v < count; ++v)
    out.push_back({perspective_camera(camera_of(v, count, bounds.centre, bounds.radius)), side_px});
  return out;
}

LitViews::LitViews(const LitMesh& mesh, const std::vector<LitCamera>& cameras, const RunContext& context)
    : mesh_(&mesh), views_(cameras.size()) {
  const RenderScene scene = render_scene(mesh.mesh, mesh.materials, mesh.texture_count);
  parallel_for(context, cameras.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      views_[v] = look(scene, cameras[v].camera, cameras[v].side_px, serial(context));
  });
}

std::uint64_t LitViews::covered_px(std::size_t view) const {
  std::uint64_t count = 0;
  for (std::size_t i = 0; i + 1 < views_[view].first.size(); ++i) count += covered(views_[view], i);
  return count;
}

Picture LitViews::picture(std::size_t view, const std::vector<RenderTexture>& textures,
                          const RenderEnvironment& environment, const RunContext& context) const {
  return shade(render_scene(mesh_->mesh, mesh_->materials, mesh_->texture_count), views_[view], textures,
               environment, context);
}

PictureVariants LitViews::pictures(std::size_t view, const std::vector<const Materials*>& materials,
                                   const std::vector<RenderTexture>& textures,
                                   const RenderEnvironment& environment, const RunContext& context) const {
  return shade_variants(render_scene(mesh_->mesh, mesh_->materials, textures.size()), views_[view], materials,
                        textures, environment, context);
}

std::vector<LitCamera> windows_of(const LitViews& views, int per_view, std::uint32_t side_px) {
  std::vector<LitCamera> out;
  for (std::size_t v = 0; v < views.count(); ++v) {
    const Visibility& view = views.visibility(v);
    std::vector<std::size_t> shown;
    for (std::size_t i = 0; i + 1 < view.first.size(); ++i)
      if (covered(view, i)) shown.push_back(i);
    if (shown.empty()) continue;
    // In raster order, so that the places are spread from top to bottom; by another part of a step in every
    // view.
    for (int k = 0; k < per_view; ++k) {
      const double rank = (k + 0.25 + 0.5 * static_cast<double>(v) / static_cast<double>(views.count())) /
                          per_view * static_cast<double>(shown.size());
      out.push_back(
          window_at(view, shown[std::min(static_cast<std::size_t>(rank), shown.size() - 1)], side_px));
    }
  }
  return out;
}

LitMeter::LitMeter(const LitViews& views, const std::vector<RenderTexture>& textures,
                   const RenderEnvironment& environment, const RunContext& context)
    : environment_(environment), reference_(views.count()), weights_(views.count()) {
  parallel_for(context, views.count(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      reference_[v] = prepare_flip(views.picture(v, textures, environment_, serial(context)));
  });
  double sum = 0;
  for (std::size_t v = 0; v < views.count(); ++v)
    sum += weights_[v] =
        static_cast<double>(std::count(reference_[v].covered.begin(), reference_[v].covered.end(), 1));
  for (double& w : weights_) w = sum > 0 ? w / sum : 0;
}

double LitMeter::difference(const LitViews& views, const std::vector<RenderTexture>& textures,
                            const RunContext& context) const {
  std::vector<double> parts(reference_.size());
  parallel_for(context, parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      parts[v] =
          flip_of(reference_[v], prepare_flip(views.picture(v, textures, environment_, serial(context))));
  });
  double sum = 0;
  for (std::size_t v = 0; v < parts.size(); ++v) sum += weights_[v] * parts[v];
  return sum;
}

std::vector<double> LitMeter::differences(const LitViews& views, const std::vector<RenderTexture>& textures,
                                          std::vector<OtherTextures>&& changes,
                                          const RunContext& context) const {
  std::vector<RenderTexture> all = textures;
  // First the one that most textures of the others are of: they take over what was found of it.
  std::vector<Materials> materials(1, views.mesh().materials);
  for (OtherTextures& change : changes) {
    std::vector<std::int32_t> place(textures.size(), -1);
    for (auto& [t, texture] : change) {
      place.at(t) = static_cast<std::int32_t>(all.size());
      all.push_back(std::move(texture));
    }
    materials.push_back(with_textures(views.mesh().materials, place));
  }
  std::vector<const Materials*> lists;
  for (const Materials& m : materials) lists.push_back(&m);
  std::vector<double> sums(changes.size());
  for (std::size_t v = 0; v < reference_.size(); ++v) {
    const PictureVariants pictures = views.pictures(v, lists, all, environment_, context);
    parallel_for(context, sums.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k)
        sums[k] += weights_[v] * flip_of(reference_[v], prepare_flip(pictures.picture(k + 1)));
    });
  }
  return sums;
}

}  // namespace texmesh
