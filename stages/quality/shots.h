#pragma once
// Inside the room only: what the pictures show of the object, the rows in which large ones are rendered, and
// pictures beside S_0's.
#include <map>

#include "stages/quality/textures.h"
#include "stages/render/shade.h"

namespace texmesh {

/// Where a view shows S_0.
struct ShownRows {
  double first = 0, end = 1;          // parts of the picture's side
  std::vector<std::uint32_t> pixels;  // by row of a smaller picture, that show something
};

/// Bands of rows, evenly spread over those that show the object. What is compared has the values that it has
/// in the whole picture: beside it as much is rendered as filters see.
struct Bands {
  std::vector<std::uint8_t> rendered;  // as look() takes them; empty: all rows
  std::vector<std::uint8_t> compared;  // by row
  /// Takes the rows that are not compared out of the picture's covered pixels.
  void cut(Picture& picture) const;
};

/// For a size at which views show about so many pixels of the object each: one band in as many as leave
/// kEnoughPixels, but at least two bands. Whole pictures where bands would miss most of the object.
Bands choose_bands(const ShownRows& view, std::uint32_t side_px, double pixels);

/// The sphere that all pictures frame, and the extent whose length on screen is the displayed height.
struct PictureFrame {
  BoundingSphere sphere;
  double extent = 0;
};

/// Which views a model is seen from: all, a part of them where pictures are dear, and a half of that part for
/// textures in the largest pictures.
enum class ViewPart : std::uint8_t { kAll, kLarge, kLargest };
struct ViewChoice {
  int views = 1;
  std::vector<ViewPart> part;  // [views]: the smallest part that has the view
  bool has(std::size_t view, ViewPart in) const { return part[view] >= in; }
};
ViewChoice choose_views(int views, int large_views);

struct PicturePlace {
  RenderCamera camera;
  std::uint32_t side_px = 0;
};
/// The whole frame, at exactly that displayed height.
PicturePlace place_picture(const PictureFrame& frame, int view, int views, double displayed_px);

using TextureSizes = std::vector<Vec2<std::uint32_t>>;  // per shown texture, px

/// The displayed height at which the coverage of a model of so many triangles is looked at, px.
double looked_at_px(std::size_t triangles);

/// What the views show of S_0.
struct Coverage {
  PictureFrame frame;
  std::uint64_t pixels = 0;                 // of all views, at looked_at_px()
  std::vector<ShownRows> rows;              // by view
  std::vector<std::uint32_t> first_levels;  // per shown texture, the finest mip that pictures ask for
};

/// Chooses what the pictures frame: the object's sphere, unless that one shows next to nothing of the object
/// and the crowd's sphere shows more. `extent` = O_V. StageError when the scene has no extent.
Coverage frame_object(const RenderScene& scene, const TextureSizes& sizes, double extent, int views,
                      double largest_px, Notes& notes, const RunContext& context);

using ShotMaterials = std::vector<RenderMaterial>;

/// What all pictures share.
struct Studio {
  PictureFrame frame;
  ViewChoice views;
  std::vector<ShownRows> rows;  // by view
  double pixels_of_unit = 0;    // that views show on average at a displayed height of 1 px
  bool few = false;             // texels and triangles, so that fewer pictures tell as much
  RenderEnvironment environment;
  std::vector<RenderScene> scenes;      // per kept scale, S_0 first
  std::vector<RenderTexture> textures;  // the source's, then coded ones for the time that they are needed
};

/// What is shown of a scale. A picture of a large scan shows nothing of triangles of which several fall into
/// each pixel: the coarsest kept scale that has still so many stands for all finer ones.
std::size_t shown_scale(const std::vector<RenderScene>& scenes, std::size_t scale, double displayed_px);

/// How one picture, or several, differ from S_0's.
struct Loss {
  FlipSum flip;
  double dssim = 0;  // sum over the pixels
  void add(const Loss& other);
  double mean_dssim() const;
};

/// Up to which a view looks like S_0.
struct ShotLimits {
  double mean = 0, p95 = 0;
  bool hold(const Loss& loss) const;
};

/// A scale with materials, whose slots count the studio's textures.
struct Shot {
  std::size_t scale = 0;  // index into Studio::scenes
  const ShotMaterials* materials = nullptr;
  ViewPart views = ViewPart::kAll;
  std::optional<ShotLimits> ends_beyond = std::nullopt;  // views behind the first such one are left out
};
/// Per view; nothing where the shot was not taken.
using Losses = std::vector<Loss>;

/// Takes shots at one displayed height, large ones in bands of rows (framing.h). The reference is S_0 with
/// `source`, prepared once for each view that any shot asks for. One view at a time is in memory, but for
/// what FLIP and SSIM compare of the references.
class SizePictures {
 public:
  /// `with_ssim`: else dssim stays 0. `studio` and `source` must outlive the pictures; the studio's textures
  /// may change between shots, but for those that `source` reads.
  SizePictures(const Studio& studio, const ShotMaterials& source, double displayed_px, bool with_ssim)
      : studio_(studio), source_(source), displayed_px_(displayed_px), with_ssim_(with_ssim) {}
  std::vector<Losses> take(const std::vector<Shot>& shots, const RunContext& context);

 private:
  struct Reference {
    LumaPicture luma;
    FlipPicture flip;
  };
  /// The shots of one scale in one view.
  struct ScaleShots {
    std::size_t scale = 0;
    std::vector<std::size_t> shots;
  };
  static std::vector<ScaleShots> by_scale(const std::vector<Shot>& shots,
                                          const std::vector<std::size_t>& taken);
  /// Where and in which rows a view is rendered.
  struct PictureView {
    std::size_t view = 0;
    PicturePlace place;
    Bands bands;
  };
  PictureVariants pictures(std::size_t scale, const PictureView& at,
                           const std::vector<const ShotMaterials*>& materials, const RunContext& context);
  Loss compare(const Reference& reference, const Picture& test) const;
  void compare_view(std::size_t view, const std::vector<Shot>& shots, const std::vector<std::size_t>& taken,
                    std::vector<Losses>& out, const RunContext& context);
  const Studio& studio_;
  const ShotMaterials& source_;
  double displayed_px_;
  bool with_ssim_;
  std::map<std::size_t, Reference> seen_;  // by view
  // What views show of S_0: shots of large textures come one after the other.
  std::map<std::size_t, Visibility> finest_;
};

/// Of all views together, or of those in which `like` shows anything.
Loss pooled(const Losses& losses);
Loss pooled(const Losses& losses, const Losses& like);

}  // namespace texmesh
