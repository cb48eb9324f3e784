#pragma once
#include <algorithm>

#include <mutex>

#include "format/base/vec.h"
#include "format/rules/output_transform.h"
#include "stages/geometry/scale_frames.h"
#include "stages/measure/flip.h"
#include "stages/render/shade.h"
#include "tools/extract/glb/texture_source.h"
#include "tools/render/rendered_model.h"

namespace texmesh {

/// A mesh with materials whose slots count one list of textures, that of all meshes that are compared.
struct LitMesh {
  Mesh mesh;
  std::vector<RenderMaterial> materials;
  std::size_t texture_count = 0;
};

/// Of its box; 1 where it has no extent.
double longest_side(const Mesh& mesh);

/// A square picture that is taken of every mesh.
struct LitCamera {
  RenderCamera camera;
  std::uint32_t side_px = 0;
  std::vector<std::uint8_t> bands;  // as look() takes them; empty: all
  /// Takes rows that filters mix with what is beside the bands out of the picture's covered pixels.
  void cut(Picture& picture) const;
};

/// `count` directions spread evenly over the sphere around `bounds`, as texmesh render has them.
std::vector<LitCamera> cameras_around(const BoundingSphere& bounds, int count, std::uint32_t side_px);

/// What cameras see of a mesh, worked out once for any number of textures.
class LitViews {
 public:
  /// `mesh` must stay where it is.
  LitViews(const LitMesh& mesh, const std::vector<LitCamera>& cameras, const RunContext& context);
  std::size_t count() const { return views_.size(); }
  const LitCamera& camera(std::size_t view) const { return cameras_[view]; }
  std::uint64_t covered_px(std::size_t view) const;
  const Visibility& visibility(std::size_t view) const { return views_[view]; }
  const LitMesh& mesh() const { return *mesh_; }
  Picture picture(std::size_t view, const std::vector<RenderTexture>& textures,
                  const RenderEnvironment& environment, const RunContext& context) const;
  /// One per list of materials, which differ from the mesh's in the textures of their slots alone.
  PictureVariants pictures(std::size_t view, const std::vector<const std::vector<RenderMaterial>*>& materials,
                           const std::vector<RenderTexture>& textures, const RenderEnvironment& environment,
                           const RunContext& context) const;

 private:
  const LitMesh* mesh_;
  std::vector<LitCamera> cameras_;
  std::vector<Visibility> views_;
};

/// Parts of pictures `picture_px` high of the same cameras, `per_view` of each view: squares of `side_px`
/// around places that show the mesh, spread over all that do.
std::vector<LitCamera> windows_of(const LitViews& views, std::uint32_t picture_px, int per_view,
                                  std::uint32_t side_px);
/// Of a picture `picture_px` high that shows far more pixels than tell files apart: a quarter of its rows,
/// which show about as many as others do; another quarter in the next view. Else empty: all.
std::vector<std::uint8_t> bands_of(const LitViews& views, std::size_t view, std::uint32_t picture_px);

/// Textures that stand for others, by the place of those in the list.
using OtherTextures = std::map<std::size_t, RenderTexture>;

/// Mean FLIP between lit pictures (stages/render, the studio's light) over the pixels that show the object;
/// all pictures count by the pixels that the reference covers there.
class LitMeter {
 public:
  /// The pictures of `views` with these textures are the reference. `environment` must outlive the meter.
  LitMeter(const LitViews& views, const std::vector<RenderTexture>& textures,
           const RenderEnvironment& environment, const RunContext& context);
  /// 0 = equal. `views` are of the same cameras. Same bits for any number of threads.
  double difference(const LitViews& views, const std::vector<RenderTexture>& textures,
                    const RunContext& context) const;
  /// What a view adds to difference(); `made` is its place in `views`.
  double part(std::size_t view, const LitViews& views, std::size_t made,
              const std::vector<RenderTexture>& textures, const RunContext& context) const;
  std::size_t count() const { return weights_.size(); }
  /// The view that shows most of the object.
  std::size_t fullest() const {
    return static_cast<std::size_t>(std::ranges::max_element(weights_) - weights_.begin());
  }
  /// The same of each of several changes of the textures, all pictures of a view at once.
  std::vector<double> differences(const LitViews& views, const std::vector<RenderTexture>& textures,
                                  std::vector<OtherTextures>&& changes, const RunContext& context) const;

 private:
  const RenderEnvironment& environment_;
  std::vector<FlipPicture> reference_;
  std::vector<double> weights_;  // sum 1, or nothing is seen
};

/// What materials read of an image: colours (sRGB) or plain numbers.
struct PictureTexture {
  std::size_t image = 0;  // index into Reference::images
  bool srgb = false;
};

/// What all files of a search are compared with: the package's best in lit pictures. It does not change once
/// it is made, and does not depend on the number of bytes. With ExtractEffort::kFast it has no picture: no
/// cameras, views and meters, and texels count as shown that the coarsest scale shows.
struct Reference {
  /// Reads the package's best from `textures`, which learns which of its texels are shown. `shown_by`: with
  /// kFast the scale whose texels count as shown, else the coarsest. StageError for S_0 without an extent.
  Reference(PackageReader& package, const ExtractBudget& wishes, const OutputTransform& place,
            TextureSource& textures, const RunContext& context, std::optional<int> shown_by = {});
  Reference(const Reference&) = delete;  // meters and views point into it
  Reference& operator=(const Reference&) = delete;

  /// Takes the model's mesh. Its materials read the textures of `shown`.
  LitMesh lit_mesh(Model& model) const;
  /// The texels of an image that S_0 shows, as TexturePlane::coverage.
  std::vector<std::uint8_t> shown_texels(std::size_t image, std::uint32_t width_px,
                                         std::uint32_t height_px) const;
  /// Levels of an image at a share of its sides that are finer than pictures read.
  std::uint32_t unread_levels(std::size_t image, double share) const;

  PackageReader& package;
  const ExtractBudget wishes;  // but for its numbers of bytes
  const OutputTransform place;
  RunContext context;                        // without progress
  std::uint32_t side_px = 0;                 // of the pictures
  std::vector<PackageImage> images;          // all of the package
  Model source;                              // S_0, without its mesh, which `finest` has
  double extent = 1;                         // longest side of its box
  NormalSamples light;                       // of S_0, which coarser scales are lit as
  std::vector<double> texels_per_pixel;      // of the displayed surface, by image at full size
  std::vector<std::size_t> groups;           // by image: alike for images that show in the same pixels
  std::vector<PictureTexture> shown;         // the textures of all pictures
  std::vector<RenderTexture> best_textures;  // by `shown`
  RenderEnvironment environment;
  LitMesh finest;
  std::vector<LitCamera> cameras, windows;  // of whole pictures, and of their parts
  std::unique_ptr<const LitViews> finest_views, finest_windows;
  std::unique_ptr<const LitMeter> window_meter, whole_meter;

 private:
  /// By group of images with equal texels shown, and size.
  struct KnownTexels {
    std::mutex mutex;
    std::map<std::tuple<std::size_t, std::uint32_t, std::uint32_t>, std::vector<std::uint8_t>> bits;
  };
  std::int32_t shown_texture(const Model& model, const TextureRef& reference, TextureUse use) const;
  void use_tables(int shown_by);
  void find_textures();
  bool shows(const TextureRef& ref, std::size_t image) const;
  double fewest_texels_per_pixel(std::size_t image) const;
  void find_groups();
  void find_alike();
  void choose_views(const LitViews& small);
  void measure_surface(double pixels);
  void read_best_textures(TextureSource& textures);
  std::vector<double> fewest_texels_;  // per pixel, by image at full size, where pictures show it
  std::vector<std::size_t> alike_;     // by image: the first that the same triangles show in the same way
  std::unique_ptr<KnownTexels> known_texels_ = std::make_unique<KnownTexels>();
};

/// A side of a texture made smaller. Of 128 px and more a multiple of 16, so that viewers can halve it
/// several times: smaller copies of odd sizes lie beside their place.
std::uint32_t side_of(std::uint32_t full, double share);

}  // namespace texmesh
