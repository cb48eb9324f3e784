#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "stages/data/pixels.h"
#include "stages/render/environment.h"
#include "tools/render/rendered_model.h"

namespace texmesh {

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

}  // namespace texmesh
