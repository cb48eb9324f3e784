#include "tools/inspect/atlas/atlas_subject.h"

#include "stages/base/parallel.h"
#include "stages/image/decode_image.h"
#include "tools/inspect/package_mesh.h"
#include "tools/render/plane_pixels.h"
#include "tools/render/rendered_model.h"

namespace texmesh {
namespace {

/// By image, whether some material has it as base colour. Other textures' seams say nothing: normals of two
/// charts differ because their axes do.
std::vector<bool> colour_images(const Model& model) {
  std::vector<bool> out(model.images.size());
  for (const Material& m : model.materials)
    if (m.base_colour_texture.used()) out.at(static_cast<std::size_t>(m.base_colour_texture.image)) = true;
  return out;
}

/// Everything but sides and colours of the images.
AtlasSubject bare_subject(Model&& model) {
  AtlasSubject out;
  for (const Image& image : model.images) out.image_names.push_back(image.name);
  out.images.resize(model.images.size());
  out.colours.resize(model.images.size());
  out.mesh = std::move(model.mesh);
  out.materials = std::move(model.materials);
  out.notes = std::move(model.notes);
  return out;
}

void point_at_colours(AtlasSubject& subject) {
  for (std::size_t i = 0; i < subject.images.size(); ++i)
    if (!subject.colours[i].data.empty()) subject.images[i].colours = &subject.colours[i];
}

}  // namespace

AtlasSubject atlas_subject(Model model, const RunContext& context) {
  const std::vector<Image> images = std::move(model.images);
  model.images.clear();
  for (const Image& image : images) {
    model.images.emplace_back();
    model.images.back().name = image.name;
  }
  const std::vector<bool> decoded = colour_images(model);
  AtlasSubject out = bare_subject(std::move(model));
  parallel_for(context, images.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (decoded[i]) out.colours[i] = decode_image(images[i], FloatEncoding::kSrgb);
  });
  for (std::size_t i = 0; i < images.size(); ++i)
    out.images[i] = {images[i].width_px, images[i].height_px, nullptr};
  point_at_colours(out);
  return out;
}

AtlasSubject atlas_subject(const std::string& path, const RunContext& context) {
  return atlas_subject(import_file(path, {}, context).model, context);
}

AtlasSubject atlas_subject(PackageReader& package, const RunContext& context) {
  Model model = finest_scale(package, context).model;
  const std::vector<bool> decoded = colour_images(model);
  AtlasSubject out = bare_subject(std::move(model));
  for (std::size_t i = 0; i < out.images.size(); ++i) {
    const std::int32_t plane = plane_of_image(package.textures(), out.image_names[i]);
    if (plane < 0) continue;  // a picture that belongs to no texture stays without sides: it is no atlas
    const TextureInfo& info = package.textures()[static_cast<std::size_t>(plane)];
    out.images[i] = {info.width_px, info.height_px, nullptr};
    out.image_names[i] = info.name;
    if (decoded[i])
      out.colours[i] = read_plane(package, static_cast<std::uint32_t>(plane), kBestRung, context);
  }
  point_at_colours(out);
  return out;
}

}  // namespace texmesh
