#include "tools/render/rendered_model.h"

#include <set>

#include "format/container/layout.h"
#include "pipeline/import/named_files.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/resolver.h"
#include "stages/base/parallel.h"
#include "stages/condition/condition.h"
#include "stages/image/decode_image.h"

namespace texmesh {
namespace {

constexpr const char* kEmissiveStrength = "KHR_materials_emissive_strength";  // the one that is rendered

/// The index of a texture in the model's list, where it may be new; -1 = nothing to read.
std::int32_t texture_of(RenderedModel& model, const TextureRef& reference, TextureUse use) {
  const std::vector<Vec2f>& uv = reference.texcoord == 0 ? model.mesh.uv0 : model.mesh.uv1;
  if (!reference.used() || reference.texcoord > 1 || uv.empty()) return -1;
  const TextureImage wanted{static_cast<std::uint32_t>(reference.image), is_srgb(use)};
  std::vector<TextureImage>& all = model.texture_images;
  const auto found = std::find(all.begin(), all.end(), wanted);
  const auto index = static_cast<std::int32_t>(found - all.begin());
  if (found == all.end()) all.push_back(wanted);
  return index;
}

/// Files beneath the model's folder; for a mesh of an unpacked package also the package's previews, which
/// stand beside that folder.
class ModelFiles : public Resolver {
 public:
  explicit ModelFiles(const std::filesystem::path& folder) : folder_(folder), files_(folder) {}

  std::optional<Bytes> read(const std::string& uri, std::uint64_t max_bytes) override {
    if (!is_preview_uri(uri) || !in_package()) return files_.read(uri, max_bytes);
    if (!package_) package_.emplace(folder_ / "..");
    return package_->read(uri.substr(std::string_view("../").size()), max_bytes);
  }
  std::vector<std::string> similar(const std::string& uri) override { return files_.similar(uri); }
  bool failed_for_resources() const {
    return files_.failed_for_resources() || (package_ && package_->failed_for_resources());
  }

 private:
  bool in_package() const {
    return std::filesystem::is_regular_file(std::filesystem::symlink_status(folder_ / ".." / kManifestPath));
  }
  std::filesystem::path folder_;
  FileResolver files_;
  std::optional<FileResolver> package_;
};

void note_what_is_left_out(const std::vector<Material>& materials, Notes& notes) {
  std::set<std::string> names;
  for (const Material& m : materials)
    for (const MaterialExtension& e : m.extensions)
      if (e.name != kEmissiveStrength) names.insert(e.name);
  for (const std::string& name : names)
    add_warning(notes, "not-rendered", "", name + " is not rendered: the base material is shown");
}

}  // namespace

RenderedModel untextured_model(Mesh mesh, const std::vector<Material>& materials) {
  RenderedModel model;
  model.mesh = std::move(mesh);
  model.bounds = bounding_sphere(model.mesh.positions);
  for (const Material& m : materials)
    model.materials.push_back(render_material(m, [&model](const TextureRef& reference, TextureUse use) {
      return texture_of(model, reference, use);
    }));
  note_what_is_left_out(materials, model.notes);
  return model;
}

RenderedModel rendered_model(ImportedModel imported, const RunContext& context) {
  Model& source = imported.model;
  if (source.mesh.normals.empty() && !imported.normals_by_specification)
    source.mesh = condition_mesh(source.mesh, false, {}, context).mesh;
  RenderedModel model = untextured_model(std::move(source.mesh), source.materials);
  model.notes.insert(model.notes.begin(), source.notes.begin(), source.notes.end());
  std::vector<Pixels> pixels(model.texture_images.size());
  parallel_for(context, pixels.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const TextureImage& from = model.texture_images[t];
      pixels[t] =
          decode_image(source.images.at(from.image), from.srgb ? FloatEncoding::kSrgb : FloatEncoding::kAsIs);
    }
  });
  for (std::size_t t = 0; t < pixels.size(); ++t)
    model.textures.push_back(render_texture(std::move(pixels[t]), model.texture_images[t].srgb, 0, context));
  return model;
}

ImportedModel import_file(const std::string& path, const ImportOptions& options, const RunContext& context) {
  const std::filesystem::path file(path);
  const std::vector<std::uint8_t> bytes =
      read_input_file(file, static_cast<std::uint64_t>(options.max_file_bytes));
  ModelFiles resolver(file.parent_path());
  try {
    return import_model(file.filename().string(), bytes, resolver, options, context);
  } catch (const InputError& e) {
    if (resolver.failed_for_resources()) throw ResourceError(e.file(), e.place(), e.expected(), e.found());
    throw;
  }
}

RenderedModel load_rendered_model(const std::string& path, const ImportOptions& options,
                                  const RunContext& context) {
  return rendered_model(import_file(path, options, context), context);
}

void make_unlit(RenderedModel& model) {
  for (RenderMaterial& m : model.materials) m.unlit = true;
}

}  // namespace texmesh
