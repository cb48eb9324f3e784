#pragma once
// Inside the room only: textures as they look at one displayed height.
#include <cstdint>
#include <optional>
#include <vector>

#include "format/documents/quality_table.h"
#include "format/documents/tables.h"
#include "format/documents/textures.h"
#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"
#include "stages/quality/shown_textures.h"
#include "stages/render/render_texture.h"

namespace texmesh::quality {

/// What textures are made of. All of one model.
struct TextureData {
  const std::vector<Image>& images;
  const Fragments& fragments;
  const std::vector<Pixels>& pixels;
  const Ladder& ladder;
  const Previews& previews;
  const PackageTables& tables;
  std::vector<TextureInfo> infos;  // of the planes: mip and base alone
};
TextureData texture_data(const std::vector<Image>& images, const Fragments& fragments,
                         const std::vector<Pixels>& pixels, const Ladder& ladder, const Previews& previews,
                         const PackageTables& tables);

/// The source's image, as viewers of the source show it. Mips finer than `first_level` are not kept. Throws
/// as decode_image().
RenderTexture source_texture(const TextureData& data, const ShownTexture& shown, std::uint32_t first_level,
                             const RunContext& context);

/// A rung of a plane: its index in the ladder.
struct PlaneRung {
  std::uint32_t plane = 0;
  std::size_t rung = 0;
};
/// The texels of that plane, which is a mip of the texture's or the texture's own, with that alpha. Mips
/// finer than `first_level` are not kept. Fragments that no rung stores look as in the source.
RenderTexture coded_texture(const TextureData& data, const ShownTexture& shown, const PlaneRung& colour,
                            const std::optional<PlaneRung>& alpha, std::uint32_t first_level,
                            const RunContext& context);

/// The preview alone, as it is shown before anything else is there.
RenderTexture preview_texture(const TextureData& data, const ShownTexture& shown, const RunContext& context);

/// What the ladder codes, without coding: the pixels of the plane that clients show from that level on. What
/// no chart covers is filled there, so that charts' borders look other than in the source's mips.
RenderTexture uncoded_texture(const TextureData& data, const ShownTexture& shown, std::uint32_t first_level,
                              const RunContext& context);
/// The last rung of the plane that clients show from `plane_level` on. Mips finer than `first_level` are not
/// kept.
RenderTexture best_texture(const TextureData& data, const ShownTexture& shown, std::uint32_t plane_level,
                           std::uint32_t first_level, const RunContext& context);
/// Whether that rung has the source's own texels.
bool shows_source(const TextureData& data, const ShownTexture& shown, std::uint32_t first_level);

}  // namespace texmesh::quality
