#pragma once
#include <cstdint>
#include <memory>
#include <vector>

#include "stages/gltf/draco_mesh.h"
#include "tools/extract/budget/lit_meter.h"
#include "tools/extract/glb/extracted.h"
#include "tools/extract/glb/scale_file.h"
#include "tools/extract/glb/texture_source.h"

namespace texmesh {

/// What materials read of an image: colours (sRGB) or plain numbers.
struct ShownTexture {
  std::size_t image = 0;  // index into BudgetSource::textures.images()
  bool srgb = false;
};

/// What all files of one search have in common: the package's best in lit pictures, which they are compared
/// with, and its textures. For .cpp files of this folder.
struct BudgetSource {
  BudgetSource(PackageReader& package, const ExtractRequest& request, const RunContext& context);
  /// Whether a source for so many bytes is the same but for request.bytes, which may be set then.
  bool serves(std::uint64_t bytes) const;

  const PackageImage& image(std::size_t index) const { return textures.images()[index]; }
  std::size_t image_count() const { return textures.images().size(); }
  /// Takes the model's mesh. Its materials read the textures of `shown`.
  LitMesh lit_mesh(Model& model) const;
  /// The meter of whole pictures, made when it is first asked for.
  const LitMeter& whole_pictures();

  PackageReader& package;
  ExtractRequest request;
  RunContext context;
  double display_px = 0;
  std::uint32_t side_px = 0;                 // of the pictures
  TextureSource textures;                    // of the package's best rungs
  Model source;                              // S_0, without its mesh, which `finest` has
  double extent = 1;                         // longest side of its box
  NormalSamples light;                       // of S_0, which coarser scales are lit as
  std::vector<double> texels_per_pixel;      // of the displayed surface, by image at full size
  std::vector<std::size_t> groups;           // by image: alike for images that show in the same pixels
  std::vector<ShownTexture> shown;           // the textures of all pictures
  std::vector<RenderTexture> best_textures;  // by `shown`
  RenderEnvironment environment;
  LitMesh finest;
  std::vector<LitCamera> cameras, windows;  // of whole pictures, and of their parts
  std::unique_ptr<LitViews> finest_windows;
  std::unique_ptr<LitMeter> window_meter;

 private:
  std::int32_t shown_texture(const Model& model, const TextureRef& reference, TextureUse use) const;
  void find_textures();
  void find_groups();
  void measure_surface(const LitViews& views);
  void read_best_textures();
  std::unique_ptr<LitMeter> meter_;
};

/// A side of a texture made smaller. Of 128 px and more a multiple of 16, so that viewers can halve it
/// several times: smaller copies of odd sizes lie beside their place.
std::uint32_t side_of(std::uint32_t full, double share);

/// The texels of an image that S_0 shows, as TexturePlane::coverage.
std::vector<std::uint8_t> shown_texels(const BudgetSource& source, std::size_t image, std::uint32_t width_px,
                                       std::uint32_t height_px);

}  // namespace texmesh
