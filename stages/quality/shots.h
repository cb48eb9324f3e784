#pragma once
// Inside the room only: pictures beside S_0's.
#include <cstdint>
#include <vector>

#include "stages/measure/flip.h"
#include "stages/quality/framing.h"
#include "stages/render/shade.h"

namespace texmesh::quality {

using Materials = std::vector<RenderMaterial>;

/// What all pictures share.
struct Studio {
  Frame frame;
  ViewChoice views;
  RenderEnvironment environment;
  std::vector<RenderScene> scenes;      // per kept scale, S_0 first
  std::vector<RenderTexture> textures;  // the source's, then coded ones for the time that they are needed
};

/// How one picture, or several, differ from S_0's.
struct Loss {
  FlipSum flip;
  double dssim = 0;  // sum over the pixels
  void add(const Loss& other);
  double mean_dssim() const;
};

/// A scale with materials, whose slots count the studio's textures.
struct Shot {
  std::size_t scale = 0;  // index into Studio::scenes
  const Materials* materials = nullptr;
  ViewPart views = ViewPart::kAll;
};
/// Per view; nothing where the shot was not taken.
using Losses = std::vector<Loss>;

/// Takes all shots at one displayed height. The reference is S_0 with `source`. `with_ssim`: else dssim stays
/// 0. Views that no shot asks for are not rendered. One view at a time is in memory.
std::vector<Losses> take_shots(const Studio& studio, const Materials& source, double displayed_px,
                               const std::vector<Shot>& shots, bool with_ssim, const RunContext& context);

/// Of all views together, or of those in which `like` shows anything.
Loss pooled(const Losses& losses);
Loss pooled(const Losses& losses, const Losses& like);

}  // namespace texmesh::quality
