#include "tools/render/picture_sheet.h"

#include "stages/render/shade.h"

namespace texmesh {
namespace {

/// The whole sheet as if nothing stood on it.
Pixels empty_sheet(std::uint32_t width_px, std::uint32_t height_px, const RenderEnvironment& environment) {
  const std::array<std::uint8_t, 3> colour = background_colour(environment);
  Pixels sheet{width_px, height_px, 3, {}};
  sheet.data.reserve(std::size_t{width_px} * height_px * 3);
  for (std::size_t i = 0; i < std::size_t{width_px} * height_px; ++i)
    sheet.data.insert(sheet.data.end(), colour.begin(), colour.end());
  return sheet;
}

}  // namespace

RenderEnvironment environment_of(RenderLight light, const RunContext& context) {
  if (light == RenderLight::kStudio) return studio_environment();
  return prepare_environment([](Vec3f) { return Vec3f{1, 1, 1}; }, KeyLight{}, context);
}

void paste(const Pixels& picture, std::uint32_t left_px, std::uint32_t top_px, Pixels& sheet) {
  for (std::uint32_t y = 0; y < picture.height_px; ++y)
    std::memcpy(sheet.data.data() + (std::size_t{top_px + y} * sheet.width_px + left_px) * sheet.channels,
                picture.at(0, y), std::size_t{picture.width_px} * picture.channels);
}

std::array<std::uint8_t, 3> background_colour(const RenderEnvironment& environment) {
  const Pixels pixel = encode_srgb({1, {environment.background}, {0}});
  return {pixel.data[0], pixel.data[1], pixel.data[2]};
}

std::uint32_t sheet_columns(int count) {
  std::uint32_t columns = 1;
  while (columns * columns < static_cast<std::uint32_t>(std::max(count, 1))) ++columns;
  return columns;
}

PictureSheet render_sheet(const RenderedModel& model, const RenderEnvironment& environment, int count,
                          std::uint32_t side_px, const RunContext& context) {
  const std::uint32_t columns = sheet_columns(count);
  if (count < 1 || count > kMaxSheetViews) throw std::invalid_argument("a sheet of too few or many views");
  if (side_px == 0 || side_px > kMaxSheetSide / columns)
    throw std::invalid_argument("views of a sheet are empty or too large");
  PictureSheet sheet;
  sheet.columns = columns;
  sheet.rows = (static_cast<std::uint32_t>(count) + columns - 1) / columns;
  sheet.pixels = empty_sheet(columns * side_px, sheet.rows * side_px, environment);
  const RenderScene scene = model.scene();
  for (std::uint32_t k = 0; k < static_cast<std::uint32_t>(count); ++k) {
    context.check_cancelled();
    SheetView view;
    view.camera =
        perspective_camera(camera_of(static_cast<int>(k), count, model.bounds.centre, model.bounds.radius));
    view.left_px = k % columns * side_px;
    view.top_px = k / columns * side_px;
    const Picture picture =
        shade(scene, look(scene, view.camera, side_px, context), model.textures, environment, context);
    view.covered_px =
        static_cast<std::uint32_t>(std::count(picture.covered.begin(), picture.covered.end(), 1));
    paste(encode_srgb(picture), view.left_px, view.top_px, sheet.pixels);
    sheet.views.push_back(view);
    context.report((k + 1.0) / count);
  }
  return sheet;
}

}  // namespace texmesh
