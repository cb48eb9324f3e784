#include "lab/cli/plan_pictures.h"

#include "delivery/cpp/package/package_reader.h"
#include "lab/study/allocation_study.h"
#include "stages/image/decode_image.h"
#include "tools/extract/glb/standalone_glb.h"
#include "tools/extract/package_model.h"
#include "tools/inspect/provenance.h"

namespace texmesh {
namespace {

const ShownPlane& shown_plane(const ShownPackage& shown, std::uint32_t base) {
  const auto found =
      std::ranges::find_if(shown.planes, [&](const ShownPlane& p) { return p.choice.base == base; });
  if (found == shown.planes.end())
    throw InputError("plan", "/planes", "a plane for texture " + std::to_string(base), "none");
  return *found;
}

/// The source's textures in the order in which S_0's materials count them.
std::vector<RenderTexture> textures_like(const RenderedModel& model,
                                         const std::vector<TextureImage>& wanted) {
  std::vector<RenderTexture> out;
  for (const TextureImage& image : wanted) {
    const auto found = std::ranges::find(model.texture_images, image);
    if (found == model.texture_images.end())
      throw InputError("source", "", "an image for the package's " + image_name(image.image), "none");
    out.push_back(model.textures[static_cast<std::size_t>(found - model.texture_images.begin())]);
  }
  return out;
}

}  // namespace

Pixels read_shown_plane(PackageReader& package, std::uint32_t base, std::uint32_t plane,
                        std::span<const std::int32_t> rungs, const RunContext& context) {
  const TextureInfo& info = package.textures().at(plane);
  const PlaneTables& tables = package.tables().planes.at(plane);
  if (rungs.size() != tables.fragment_count())
    throw std::invalid_argument("read_shown_plane: a rung for each fragment");
  const Pixels preview =
      decode_image(probe_image(package.textures().at(base).preview.path, package.preview(base), {}));
  Pixels out = enlarged_preview(preview, info.width_px, info.height_px, info.channels);
  PlaneStreams streams(info.codec, tables, package.entry(info.tables));
  for (std::uint32_t r = 0; r < tables.rung_count(); ++r) {
    std::vector<std::uint16_t> shown;
    for (const std::uint16_t f : tables.order)
      if (rungs[f] == static_cast<std::int32_t>(r)) shown.push_back(f);
    if (shown.empty() && !codec_traits(info.codec).incremental) continue;
    streams.add_pack(r, package.entry(info.rungs[r]));
    decode_fragments(info, info.rungs[r].path, streams, shown, out, context);
  }
  return out;
}

ShownPackage shown_by(PackageReader& package, const DeliveryPlan& plan, const FragmentList& list) {
  ShownPackage shown{plan.scale, {}, plan.proxy};
  std::map<std::uint32_t, std::size_t> place_of;
  for (const PlaneChoice& choice : plan.planes) {
    place_of[choice.plane] = shown.planes.size();
    const std::size_t fragments = package.tables().planes.at(choice.plane).fragment_count();
    shown.planes.push_back({choice, std::vector<std::int32_t>(fragments, -1)});
  }
  for (std::size_t i = 0; i < list.fragments.size(); ++i)
    shown.planes[place_of.at(list.fragments[i].plane)].rungs[list.fragments[i].fragment] =
        plan.textures.rungs[i];
  return shown;
}

PlanPictures::PlanPictures(PackageReader& package, const std::string& source, int views,
                           const RunContext& context)
    : package_(package),
      views_(views),
      context_(context),
      environment_(environment_of(RenderLight::kStudio, context)),
      finest_(bare_scale(package, 0, context)) {
  RenderedModel model = source.empty()
                            ? package_model(package, {0, PackageTextures::kRung, kBestRung}, context)
                            : load_rendered_model(source, {}, context);
  const Provenance made = read_provenance(package.entry(package.manifest().provenance));
  const bool rebuilt = !source.empty() && made.stages.contains("atlas");
  source_ = rebuilt ? model.textures : textures_like(model, finest_.texture_images);
  if (rebuilt) model_ = std::move(model);
}

const RenderedModel& PlanPictures::scale(int scale) {
  if (scale == 0) return finest_;
  const auto found = scales_.find(scale);
  if (found != scales_.end()) return found->second;
  return scales_.emplace(scale, package_scale(package_, scale, finest_, context_)).first->second;
}

PlanPictures::Place PlanPictures::place(int view, double displayed_px) const {
  const BoundingSphere& sphere = finest_.bounds;
  Place out{perspective_camera(camera_of(view, views_, sphere.centre, sphere.radius)), 0};
  const double distance = length(out.camera.eye - sphere.centre);
  const double side =
      displayed_px * 2 * distance * out.camera.tan_half_fov / package_.manifest().object_height;
  out.side_px = static_cast<std::uint32_t>(std::clamp(std::ceil(side), 1.0, 8192.0));
  out.camera.tan_half_fov *= out.side_px / side;  // a little more is seen, so that the height is exact
  return out;
}

std::vector<RenderTexture> PlanPictures::textures_of(const ShownPackage& shown) {
  const auto texels = [&](std::uint32_t base) {
    const ShownPlane& p = shown_plane(shown, base);
    return read_shown_plane(package_, base, p.choice.plane, p.rungs, context_);
  };
  const std::vector<PackageImage> images = package_images(package_);
  std::vector<RenderTexture> out;
  for (const TextureImage& from : finest_.texture_images) {
    const auto image = std::ranges::find(images, from.image, &PackageImage::image);
    if (image == images.end())
      throw FormatError(kTexturesPath, "", image_name(from.image) + ", which a mesh uses", "none");
    Pixels pixels = texels(image->plane);
    if (image->alpha_plane) pixels = with_alpha_of(*image, pixels, texels(*image->alpha_plane));
    out.push_back(render_texture(std::move(pixels), from.srgb, 0, context_));
  }
  return out;
}

const std::vector<PlanPictures::Reference>& PlanPictures::references(double displayed_px) {
  if (std::exchange(referenced_px_, displayed_px) == displayed_px) return references_;
  references_.clear();
  const RenderScene scene = finest_.scene(), model = model_ ? model_->scene() : scene;
  for (int v = 0; v < views_; ++v) {
    Reference reference{place(v, displayed_px), {}, {}};
    reference.seen = look(scene, reference.place.camera, reference.place.side_px, context_);
    const Visibility at = look(model, reference.place.camera, reference.place.side_px, context_);
    reference.flip = prepare_flip(shade(model, at, source_, environment_, context_));
    references_.push_back(std::move(reference));
  }
  return references_;
}

RenderedFlip PlanPictures::measure_proxy(std::uint32_t proxy, double displayed_px) {
  const RenderedModel model = package_proxy(package_, proxy, context_);
  const RenderScene scene = model.scene();
  FlipSum whole;
  for (const Reference& reference : references(displayed_px)) {
    const Visibility seen = look(scene, reference.place.camera, reference.place.side_px, context_);
    whole.add(compare_flip(reference.flip,
                           prepare_flip(shade(scene, seen, model.textures, environment_, context_))));
  }
  return {whole.mean(), 0, whole.mean()};
}

RenderedFlip PlanPictures::measure(const ShownPackage& shown, double displayed_px) {
  if (shown.proxy) return measure_proxy(*shown.proxy, displayed_px);
  const std::vector<RenderTexture> textures = textures_of(shown);
  const RenderScene finest = finest_.scene(), coarse = scale(shown.scale).scene();
  FlipSum whole, geometry, coded;
  for (const Reference& reference : references(displayed_px)) {
    const auto add = [&](const RenderScene& scene, const Visibility& seen,
                         const std::vector<RenderTexture>& with, FlipSum& sum) {
      sum.add(compare_flip(reference.flip, prepare_flip(shade(scene, seen, with, environment_, context_))));
    };
    add(finest, reference.seen, textures, coded);
    if (shown.scale == 0) continue;
    const Visibility seen = look(coarse, reference.place.camera, reference.place.side_px, context_);
    add(coarse, seen, textures, whole);
    if (!model_) add(coarse, seen, source_, geometry);
  }
  return {(shown.scale == 0 ? coded : whole).mean(), geometry.mean(), coded.mean()};
}

}  // namespace texmesh
