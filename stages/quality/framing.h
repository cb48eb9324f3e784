#pragma once
// Inside the room only: what the pictures show of the object, and the rows in which large ones are rendered.
#include "format/base/box.h"
#include "stages/measure/picture.h"
#include "stages/quality/textures.h"

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

inline constexpr double kLookedAtPx = 192;  // displayed height at which the coverage is looked at

/// What the views show of S_0.
struct Coverage {
  PictureFrame frame;
  std::uint64_t pixels = 0;                 // of all views, at kLookedAtPx
  std::vector<ShownRows> rows;              // by view
  std::vector<std::uint32_t> first_levels;  // per shown texture, the finest mip that pictures ask for
};

/// Chooses what the pictures frame: the object's sphere, unless that one shows next to nothing of the object
/// and the crowd's sphere shows more. `extent` = O_V. StageError when the scene has no extent.
Coverage frame_object(const RenderScene& scene, const TextureSizes& sizes, double extent, int views,
                      double largest_px, Notes& notes, const RunContext& context);

}  // namespace texmesh
