#pragma once
// Inside the room only: what the pictures show of the object.
#include <cstdint>
#include <vector>

#include "format/base/box.h"
#include "format/base/note.h"
#include "stages/quality/bands.h"
#include "stages/quality/shown_textures.h"
#include "stages/render/visibility.h"

namespace texmesh::quality {

/// The sphere that all pictures frame, and the extent whose length on screen is the displayed height.
struct Frame {
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
PicturePlace place_picture(const Frame& frame, int view, int views, double displayed_px);

using TextureSizes = std::vector<Vec2<std::uint32_t>>;  // per shown texture, px

inline constexpr double kLookedAtPx = 192;  // displayed height at which the coverage is looked at

/// What the views show of S_0.
struct Coverage {
  Frame frame;
  std::uint64_t pixels = 0;                 // of all views, at kLookedAtPx
  std::vector<ShownRows> rows;              // by view
  std::vector<std::uint32_t> first_levels;  // per shown texture, the finest mip that pictures ask for
};

/// Chooses what the pictures frame: the object's sphere, unless that one shows next to nothing of the object
/// and the crowd's sphere shows more. `extent` = O_V. StageError when the scene has no extent.
Coverage frame_object(const RenderScene& scene, const TextureSizes& sizes, double extent, int views,
                      double largest_px, Notes& notes, const RunContext& context);

}  // namespace texmesh::quality
