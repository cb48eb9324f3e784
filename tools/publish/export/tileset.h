#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "format/base/vec.h"
#include "format/documents/about.h"
#include "format/documents/manifest.h"

namespace texmesh {

/// A scale with textures that suit a displayed height: what `texmesh extract --display` gives for it.
struct TileLevel {
  int scale = 0;
  double displayed_px = 0;  // height up to which it is shown; kAnyDisplayPx for the finest
  double texture_px = 0;    // height that the textures suit; 0 = full size
  double error_max = 0;     // of the scale as the manifest has it, object units
  std::string uri;          // of its GLB, relative to tileset.json
  friend bool operator==(const TileLevel&, const TileLevel&) = default;
};

/// Planes of the textures that suit a displayed height; of 0 those of full size.
using PlanesOfHeight = std::function<std::vector<std::uint32_t>(double displayed_px)>;
/// Finest first: what suits `display_px` (0 = everything), then what suits 4096, 2048, ... 32 px where that
/// is something else than the level before, then the coarsest scale, which a viewer shows while it waits.
/// `uri` stays "".
std::vector<TileLevel> tile_levels(const Manifest& manifest, double display_px, const PlanesOfHeight& planes);

struct Tileset {
  std::vector<TileLevel> levels;  // finest first, at least one
  Box3d bounds;                   // of all contents, in their frame (y up) and unit
  Vec3d origin;                   // where that frame stands, in its unit
  double metres = 1;              // length of the object unit in the contents' unit
  double object_height = 0;       // Manifest::object_height, object units
  double screen_error_px = 16;    // the error at which a viewer takes the next level
  std::string version;            // of the content; viewers tell tilesets apart by it
  About about;
};

/// tileset.json of 3D Tiles 1.1: one tile inside the other, the coarsest outside, refine REPLACE. What a
/// level costs is screen_error_px / displayed_px of the object's height, so that a viewer with that limit
/// changes levels at the heights that the package measured; never less than error_max. Viewers turn glTF's y
/// axis to the z axis of tiles: (x, y, z) becomes (x, -z, y), and boxes and origin here are turned so. No
/// transform scales: versions of 3D Tiles differ in what that does to errors.
std::string tileset_json(const Tileset& tileset);

}  // namespace texmesh
