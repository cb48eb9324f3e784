#pragma once
// Inside the room only: which textures show, what they are made from, and how they look at one displayed
// height.

#include "format/documents/quality_table.h"
#include "format/documents/tables.h"
#include "format/documents/textures.h"
#include "stages/data/ladder.h"
#include "stages/data/previews.h"
#include "stages/render/render_texture.h"

namespace texmesh {

inline constexpr std::uint32_t kMaxFirstLevel = 4;  // fragments' sides are multiples of 16

/// A texture that materials read: a full-size plane, with the plane of its alpha where there is one.
struct ShownTexture {
  std::uint32_t plane = 0;  // index into Fragments::planes
  std::optional<std::uint32_t> alpha;
  bool srgb = false;
  bool with_mips = true;  // false where a sampler of the source's reads level 0 alone
};

struct ShownTextures {
  std::vector<ShownTexture> textures;
  std::vector<RenderMaterial> materials;  // their slots count `textures`, and read all with mips
  std::vector<RenderMaterial> sampled;    // the same, as the source's samplers read
  bool with_mips() const { return std::ranges::all_of(textures, &ShownTexture::with_mips); }
};

/// What the reference renderer reads. References to coordinates that the mesh does not have, all but the base
/// colour of unlit materials, and the emission of materials that emit nothing do not show.
ShownTextures find_shown(const std::vector<Material>& materials, const Fragments& fragments,
                         const Mesh& mesh);

/// Per shown texture, the finest mip that more than 2 % of its fragments in pictures ask for.
class WantedMips {
 public:
  explicit WantedMips(std::size_t textures) : wanted_(textures) {}
  /// A view of S_0 that stands for one so many times as large. `sizes`: width and height of each texture, px.
  void add(const RenderScene& scene, const Visibility& view, const std::vector<Vec2<std::uint32_t>>& sizes,
           double magnification);
  /// At most kMaxFirstLevel each.
  std::vector<std::uint32_t> first_levels() const;

 private:
  std::vector<std::array<std::uint64_t, kMaxFirstLevel + 1>> wanted_;
};

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

/// The mip of a full-size plane that a client shows (format/rules/viewing.h), at most the last one
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

}  // namespace texmesh
