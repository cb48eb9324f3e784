#include "tools/extract/package_model.h"

#include "pipeline/io/file_resolver.h"
#include "stages/image/decode_image.h"
#include "tools/extract/glb/standalone_glb.h"

namespace texmesh {
namespace {

Pixels plane_texels(PackageReader& package, std::uint32_t plane, const PackageChoice& choice,
                    const RunContext& context) {
  if (choice.textures != PackageTextures::kPreview)
    return read_plane(package, plane, choice.textures == PackageTextures::kRung ? choice.rung : kBestRung,
                      context);
  return decode_image(probe_image(package.textures()[plane].preview.path, package.preview(plane), {}));
}

/// The source's file holds colours and alpha in one.
bool has_source(PackageReader& package, const PackageImage& image) {
  const TextureInfo& info = package.textures()[image.plane];
  return !info.source_extension.empty() && info.source_colours;
}

Pixels image_texels(PackageReader& package, const PackageImage& image, const PackageChoice& choice,
                    const RunContext& context) {
  if (choice.textures == PackageTextures::kSource && has_source(package, image))
    return decode_image(
        probe_image(package.textures()[image.plane].source.path, package.source(image.plane), {}),
        image.colours ? FloatEncoding::kSrgb : FloatEncoding::kAsIs);
  const Pixels colours = plane_texels(package, image.plane, choice, context);
  if (!image.alpha_plane) return colours;
  // Previews that would take too many bytes are smaller than others of their image.
  return with_alpha_of(image, colours, plane_texels(package, *image.alpha_plane, choice, context));
}

/// The image of the package that a scale's image of this name stands for.
const PackageImage& image_named(const std::vector<PackageImage>& images, const std::string& name) {
  const auto found = std::find_if(images.begin(), images.end(),
                                  [&](const PackageImage& i) { return image_name(i.image) == name; });
  if (found == images.end())
    throw FormatError(kTexturesPath, "", "image " + name + ", which a mesh uses", "none");
  return *found;
}

Model scale_model(PackageReader& package, int scale, const RunContext& context) {
  return read_model(scale_file(package, scale, context), mesh_path(scale), context);
}

}  // namespace

RenderedModel bare_scale(PackageReader& package, int scale, const RunContext& context) {
  package.scale_index(scale);  // says which scales there are
  Model source = scale_model(package, scale, context);
  RenderedModel model = untextured_model(std::move(source.mesh), source.materials);
  const std::vector<PackageImage> images = package_images(package);
  for (TextureImage& texture : model.texture_images)
    texture.image = image_named(images, source.images.at(texture.image).name).image;
  return model;
}

RenderedModel package_model(PackageReader& package, const PackageChoice& choice, const RunContext& context) {
  if (choice.textures == PackageTextures::kRung) require_rung(package, choice.rung);
  RenderedModel model = bare_scale(package, choice.scale, context);
  if (choice.scale != 0) model.bounds = bounding_sphere(scale_model(package, 0, context).mesh.positions);
  const std::vector<PackageImage> images = package_images(package);
  for (const TextureImage& from : model.texture_images) {
    const auto image = std::ranges::find(images, from.image, &PackageImage::image);
    model.textures.push_back(
        render_texture(image_texels(package, *image, choice, context), from.srgb, 0, context));
  }
  return model;
}

RenderedModel package_scale(PackageReader& package, int scale, const RenderedModel& textured,
                            const RunContext& context) {
  RenderedModel model = bare_scale(package, scale, context);
  model.bounds = textured.bounds;
  const std::vector<TextureImage>& all = textured.texture_images;
  for (RenderMaterial& material : model.materials)
    for (TextureSlot& slot : material.textures) {
      if (slot.texture < 0) continue;
      const auto found =
          std::find(all.begin(), all.end(), model.texture_images[static_cast<std::size_t>(slot.texture)]);
      slot.texture = found == all.end() ? -1 : static_cast<std::int32_t>(found - all.begin());
    }
  model.texture_images = all;
  return model;
}

RenderedModel package_proxy(PackageReader& package, std::uint32_t proxy, const RunContext& context) {
  NoFiles none;
  return rendered_model(import_package_glb(proxy_path(proxy), package.proxy_glb(proxy), none, context),
                        context);
}

}  // namespace texmesh
