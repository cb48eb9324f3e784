#include "tools/publish/export/tileset.h"

#include <nlohmann/json.hpp>

#include "format/rules/viewing.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kHighestPx = 4096, kLowestPx = 32;
constexpr double kWaitingPx = 1;  // left as soon as something finer is there
/// Thinner boxes have no inside for a viewer, whose distances to them are those to a plane.
constexpr double kThinnest = 1e-4;

Json turned(Vec3d v) { return {v.x, -v.z, v.y}; }

/// The centre, then half of each axis.
Json box_json(const Box3d& bounds) {
  const Vec3d centre = bounds.centre(), half = bounds.size() * 0.5;
  const double least = std::max({half.x, half.y, half.z}) * kThinnest;
  Json box = turned(centre);
  for (const double x : {std::max(half.x, least), 0.0, 0.0, 0.0, std::max(half.z, least), 0.0, 0.0, 0.0,
                         std::max(half.y, least)})
    box.push_back(x);
  return box;
}

double geometric_error(const Tileset& t, const TileLevel& level) {
  if (level.displayed_px >= kAnyDisplayPx) return 0;
  return t.metres * std::max(level.error_max, t.screen_error_px / level.displayed_px * t.object_height);
}

Json tile_json(const Tileset& t, const TileLevel& level) {
  Json tile{{"boundingVolume", {{"box", box_json(t.bounds)}}},
            {"geometricError", geometric_error(t, level)},
            {"refine", "REPLACE"},
            {"content", {{"uri", level.uri}}}};
  tile["extras"] = {{"scale", level.scale}, {"errorMax", level.error_max}};
  if (level.displayed_px < kAnyDisplayPx) tile["extras"]["displayedPx"] = level.displayed_px;
  return tile;
}

Json about_json(const About& about) {
  Json out = Json::object();
  const auto add = [&](const char* name, const std::string& text) {
    if (!text.empty()) out[name] = text;
  };
  add("title", about.title);
  add("creator", about.creator);
  add("copyright", copyright_line(about));
  add("licence", about.licence);
  add("licenceUrl", about.licence_url);
  if (about.epsg != 0) out["epsg"] = about.epsg;
  return out;
}

}  // namespace

std::vector<TileLevel> tile_levels(const Manifest& manifest, double display_px,
                                   const PlanesOfHeight& planes) {
  const auto level = [&](int scale, double displayed_px, double texture_px) {
    const auto found = std::ranges::find(manifest.scales, scale, &ManifestScale::scale);
    return TileLevel{scale, displayed_px, texture_px, found->error_max, ""};
  };
  const int finest = display_px > 0 ? scale_at(manifest.steps, display_px) : 0;
  std::vector<TileLevel> out{level(finest, kAnyDisplayPx, display_px)};
  std::vector<std::uint32_t> shown = planes(display_px);
  for (double px = kHighestPx; px >= kLowestPx; px /= 2) {
    if (display_px > 0 && px >= display_px) continue;
    const int scale = scale_at(manifest.steps, px);
    std::vector<std::uint32_t> these = planes(px);
    if (scale == out.back().scale && these == shown) continue;
    out.push_back(level(scale, px, px));
    shown = std::move(these);
  }
  const int coarsest = manifest.scales.back().scale;
  if (out.back().scale != coarsest) {
    const auto step = std::ranges::find(manifest.steps, coarsest, &ManifestStep::scale);
    out.push_back(level(coarsest, step == manifest.steps.end() ? kWaitingPx : step->up_to_px, kLowestPx));
  }
  return out;
}

std::string tileset_json(const Tileset& t) {
  Json tile;
  for (const TileLevel& level : t.levels) {
    Json outer = tile_json(t, level);
    if (!tile.is_null()) outer["children"] = Json::array({std::move(tile)});
    tile = std::move(outer);
  }
  const Json place = turned(t.origin);
  if (t.origin != Vec3d{})
    tile["transform"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, place[0], place[1], place[2], 1};
  Json asset{{"version", "1.1"}, {"tilesetVersion", t.version}};
  if (Json about = about_json(t.about); !about.empty()) asset["extras"] = std::move(about);
  const double whole = std::max(2 * t.metres * t.object_height, tile["geometricError"].get<double>());
  const Json out{{"asset", std::move(asset)}, {"geometricError", whole}, {"root", std::move(tile)}};
  return out.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace texmesh
