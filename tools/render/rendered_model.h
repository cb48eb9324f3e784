#pragma once

#include <filesystem>

#include "delivery/cpp/package/package_reader.h"
#include "pipeline/import/import.h"
#include "pipeline/io/resolver.h"
#include "stages/render/environment.h"
#include "stages/render/render_texture.h"

namespace texmesh {

class PlaneStreams;

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

/// What `make` makes of that model's pictures. An InputError of a picture says the model's file first.
template <class Make>
auto with_model_named(const std::string& path, const Make& make) {
  try {
    return make();
  } catch (const ResourceError&) {
    throw;
  } catch (const InputError& e) {
    throw InputError(std::filesystem::path(path).filename().string(),
                     e.file() + (e.place().empty() ? "" : ": " + e.place()), e.expected(), e.found());
  }
}

/// Such a file for the renderer. Errors as import_file().
RenderedModel load_rendered_model(const std::string& path, const ImportOptions& options,
                                  const RunContext& context);

/// Base colours alone: every material becomes unlit.
void make_unlit(RenderedModel& model);

/// Lights that can be asked for by name.
enum class RenderLight : std::uint8_t {
  kStudio,  // that of all measurements
  kWhite    // radiance 1 from everywhere, no key light
};
RenderEnvironment environment_of(RenderLight light, const RunContext& context);

inline constexpr int kMaxSheetViews = 64;
inline constexpr std::uint32_t kMaxSheetSide = 16384;  // px

/// One view of a sheet.
struct SheetView {
  RenderCamera camera;                    // in the mesh's local frame
  std::uint32_t covered_px = 0;           // pixels that show the object
  std::uint32_t left_px = 0, top_px = 0;  // where it stands
};

/// Views of a model in one picture, row by row on a grid as square as they allow.
struct PictureSheet {
  Pixels pixels;  // RGB, sRGB encoded
  std::uint32_t columns = 0, rows = 0;
  std::vector<SheetView> views;
};

/// `count` views, each `side_px` square, from directions spread evenly over the sphere; a single one shows
/// the front from its right, a little from above. Cells that are left over show the background.
/// std::invalid_argument for a count outside 1..kMaxSheetViews and for a sheet wider than kMaxSheetSide. Same
/// bytes for any thread count.
PictureSheet render_sheet(const RenderedModel& model, const RenderEnvironment& environment, int count,
                          std::uint32_t side_px, const RunContext& context);

/// Copies `picture` into the sheet, which has as many channels and room for it there.
void paste(const Pixels& picture, std::uint32_t left_px, std::uint32_t top_px, Pixels& sheet);

/// What stands where nothing does, sRGB encoded.
std::array<std::uint8_t, 3> background_colour(const RenderEnvironment& environment);

/// How many views stand side by side.
std::uint32_t sheet_columns(int count);

/// A plane put together again from all its fragments at one rung: width x height texels without the
/// fragments' overhang. What is not stored (nobody sees it) continues its neighbours smoothly, so that
/// smaller copies show no seams; where `shown` tells the texels that are shown (TexturePlane::coverage), all
/// others do. Reads the rung as one entry, digest checked. FormatError when the package is
/// damaged or the plane has more than 4e8 texels. Same result for any thread count.
Pixels read_plane(PackageReader& package, std::uint32_t plane, std::uint32_t rung, const RunContext& context,
                  const std::vector<std::uint8_t>* shown = nullptr);

/// Decodes fragments of a plane, of those that `streams` has, into their places in it. FormatError naming
/// `rung_path` for a fragment of another size.
void decode_fragments(const TextureInfo& info, const std::string& rung_path, const PlaneStreams& streams,
                      std::span<const std::uint16_t> fragments, Pixels& plane, const RunContext& context);

/// InputError where no plane of the package has that rung. kBestRung is always there.
void require_rung(PackageReader& package, std::uint32_t rung);

}  // namespace texmesh
