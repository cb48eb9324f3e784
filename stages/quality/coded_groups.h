#pragma once
// Inside the room only: groups of planes, and the rungs at which they are sampled.
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "stages/quality/rung_textures.h"

namespace texmesh::quality {

struct PlanesOfGroup {
  PlaneGroup group = PlaneGroup::kColour;
  std::vector<std::uint32_t> planes;  // full-size ones that show; where none of the group shows, all of it
};
/// Groups that the model has, rising.
std::vector<PlanesOfGroup> find_groups(const ShownTextures& shown, const Fragments& fragments);

/// One way to show all planes of a group: a rung of each.
struct Knot {
  std::vector<PlaneRung> rungs;       // per plane of the group; the plane is that of the displayed height
  std::vector<double> dssim, weight;  // per fragment of all planes: 1 - SSIM, and its part of the surface
  double mean_dssim = 0;              // weighted
};

/// How large the object is displayed.
struct Display {
  double surface_area = 0, object_height = 0;  // object units
  double displayed_px = 0;
};

/// The mip of a full-size plane that a client shows (format/rules/mip_choice.h), at most the last one
/// with whole texels along both axes.
std::uint32_t shown_plane(const TextureData& data, std::uint32_t full_size, const Display& display);

/// The size of texels on the screen, as a logarithm of base 2 of pixels: mean over the planes that clients
/// show of the group, by their surface.
double texel_level(const TextureData& data, const PlanesOfGroup& group, const Display& display);

/// A part of the group's surface, and the mip that clients show there.
struct ShownMip {
  std::uint32_t mip = 0;
  double part = 0;  // of 1; all 0 for a group without a surface
};
std::vector<ShownMip> shown_mips(const TextureData& data, const PlanesOfGroup& group, const Display& display);

/// From the highest rung to the lowest. `samples` rungs of the first plane's ladder,
/// first and last among them (one: the last); the others have the rung whose quality is nearest.
std::vector<Knot> sample_knots(const TextureData& data, const PlanesOfGroup& group, int samples,
                               const Display& display);

/// Makes a texture, as often as it is called: textures take more memory than anything else of the stage.
using TextureMaker = std::function<RenderTexture(const RunContext&)>;
/// The texture at that knot; empty where the knot has not the texture's planes. `data` and `shown` must
/// outlive the maker.
TextureMaker texture_at(const TextureData& data, const ShownTexture& shown, const Knot& knot,
                        std::uint32_t source_first_level);
/// The same with the previews of the group's planes.
std::optional<RenderTexture> preview_at(const TextureData& data, const ShownTexture& shown,
                                        const PlanesOfGroup& group, const RunContext& context);

}  // namespace texmesh::quality
