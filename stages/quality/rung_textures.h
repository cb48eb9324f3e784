#pragma once
// Inside the room only: textures as they look at a rung.
#include <cstdint>
#include <vector>

#include "stages/base/run_context.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"
#include "stages/quality/shown_textures.h"
#include "stages/render/render_texture.h"

namespace texmesh::quality {

inline constexpr std::int32_t kSourceRung = -1;  // the source's texels

/// A column of the quality table. Each plane has a rung of its own here, though a column is still named by
/// one quality.
struct RungChoice {
  int quality = 100;
  std::vector<std::int32_t> rungs;  // per plane of Fragments: index of the rung, or kSourceRung
};

/// The source's texels everywhere.
RungChoice source_choice(const Fragments& fragments);
/// `samples` rungs of the sampled plane, spread over its ladder, first and last among them (one: the last).
/// All other planes at the rung whose quality is nearest. One choice of quality 100 without planes.
std::vector<RungChoice> sampled_choices(const ShownTextures& shown, const Fragments& fragments,
                                        const Ladder& ladder, int samples);

/// All shown textures at that choice. Mips finer than first_levels are not kept, and no texture has two full
/// copies in memory. Fragments that no rung stores look as in the source.
std::vector<RenderTexture> textures_of(const ShownTextures& shown, const Fragments& fragments,
                                       const std::vector<Pixels>& pixels, const Ladder& ladder,
                                       const RungChoice& choice,
                                       const std::vector<std::uint32_t>& first_levels,
                                       const RunContext& context);

}  // namespace texmesh::quality
