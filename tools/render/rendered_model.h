#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "format/base/vec.h"
#include "format/model/model.h"
#include "pipeline/import/import.h"
#include "stages/render/render_texture.h"
#include "stages/render/visibility.h"

namespace texmesh {

/// What a texture of a RenderedModel is made from: an image, read as colours (sRGB) or as plain numbers.
struct TextureImage {
  std::uint32_t image = 0;  // as the materials count images
  bool srgb = false;
  friend bool operator==(const TextureImage&, const TextureImage&) = default;
};

/// A model as the reference renderer (stages/render) takes it.
struct RenderedModel {
  Mesh mesh;
  std::vector<RenderMaterial> materials;  // as mesh.triangle_material counts them
  std::vector<TextureImage> texture_images;
  std::vector<RenderTexture> textures;  // one of each of texture_images
  BoundingSphere bounds;                // what cameras look at; local frame, object units
  Notes notes;                          // of the import, and what of the materials is not rendered

  /// Points into this model, which must stay where it is.
  RenderScene scene() const { return render_scene(mesh, materials, texture_images.size()); }
};

/// Mesh, materials, bounds and the list of the textures that they read; `textures` stays empty for the caller
/// to fill. References to a set of texture coordinates that the mesh does not have count as unused.
/// Extensions of materials that the renderer does not know get a warning each, "not-rendered".
RenderedModel untextured_model(Mesh mesh, const std::vector<Material>& materials);

/// With the images decoded by stages/image, one time for colours and one for numbers, alpha kept. Meshes of
/// formats that do not say what absent normals mean get smooth ones, as a compile makes them. InputError for
/// an image that does not decode. Same result for any thread count.
RenderedModel rendered_model(ImportedModel imported, const RunContext& context);

/// A file that compile would take, with the files beneath its folder that the file names. A mesh of an
/// unpacked package also gets the package's previews ("../preview/PPP.jpg", beside a manifest). Errors as
/// import_model(); ResourceError where the machine is to blame.
ImportedModel import_file(const std::string& path, const ImportOptions& options, const RunContext& context);

/// Such a file for the renderer. Errors as import_file().
RenderedModel load_rendered_model(const std::string& path, const ImportOptions& options,
                                  const RunContext& context);

/// Base colours alone: every material becomes unlit.
void make_unlit(RenderedModel& model);

}  // namespace texmesh
