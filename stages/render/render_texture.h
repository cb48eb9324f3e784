#pragma once
#include "stages/data/fragments.h"
#include "stages/data/pixels.h"
#include "stages/render/visibility.h"

namespace texmesh {

/// A texture with its mips, as a graphics processor holds it: 8 bits a channel. Level l has the sides
/// max(1, side / 2^l), rounded down. Channels: 1 grey, 2 grey and alpha, 3 RGB, 4 RGBA.
struct RenderTexture {
  std::uint32_t width_px = 0, height_px = 0;  // of level 0, which may not be kept
  bool srgb = false;                          // colours are sRGB encoded; alpha never is
  std::uint32_t first_level = 0;
  std::vector<Pixels> levels;  // first_level, first_level + 1, ... 1 x 1
};

/// A mip of an image that is not empty, so many levels coarser, at most down to 1 x 1; made as
/// complete_mips() makes the levels of a texture. Of a part whose place and sides are multiples of 2^levels
/// it is that part of the whole image's mip, where the image's sides are such multiples, too.
Pixels coarser_level(Pixels image, bool srgb, std::uint32_t levels, const RunContext& context);

/// Completes the chain from its first level, which must be there with the sides of its number. Each level is
/// the one before it, read bilinearly at the middles of the new texels: with even sides that is the mean of
/// 2 x 2. sRGB colours are averaged in linear light. Every level is rounded to 8 bits. Same bits on every
/// machine and for any thread count.
void complete_mips(RenderTexture& texture, const RunContext& context);

/// The texture of a whole image, which is level 0. Levels finer than `first_level` are not kept.
/// std::invalid_argument when the image is empty or has other than 1..4 channels.
RenderTexture render_texture(Pixels image, bool srgb, std::uint32_t first_level, const RunContext& context);

/// Where and how large a texture is read: coordinates after the slot's transform, and their derivatives by
/// the picture's pixels.
struct TextureFootprint {
  Vec2f uv, uv_dx, uv_dy;
};

/// Where textures of one size are read: all of it that does not depend on their texels, so that it is worked
/// out once for several textures.
class TextureSite {
 public:
  TextureSite() = default;
  /// `size_px` of level 0. Textures that are read keep no level finer than `first_level`.
  TextureSite(Vec2<std::uint32_t> size_px, std::uint32_t first_level, const TextureSlot& slot,
              const TextureFootprint& footprint);
  /// RGBA as a shader reads it, of a texture of that size: linear light for sRGB colours, else 0..1; grey in
  /// all three channels; alpha 1 where there is none. The level is log2 of the longer of the two derivatives
  /// in texels (OpenGL 4.6, 8.14, anisotropy 1), at least the first level kept. Not finite coordinates read
  /// the texture's corner.
  Vec4f read(const RenderTexture& texture) const;
  /// Asks for the texels that read() will need: large textures lie in memory, not in caches.
  void prefetch(const RenderTexture& texture) const;

  /// Two texels and the part of the way from the first to the second.
  struct Axis {
    std::int32_t first = 0, second = 0;
    float part = 0;
  };
  struct Place {
    Axis x, y;
  };

 private:
  Place place_in(std::uint32_t width_px, std::uint32_t height_px) const;
  void find_places(Vec2<std::uint32_t> size_px);
  Vec4f read_level(const RenderTexture& texture, std::size_t level) const;
  Vec2f uv_;  // folded into 0..1
  Wrap wrap_s_ = Wrap::kRepeat, wrap_t_ = Wrap::kRepeat;
  bool nearest_ = false;  // of the first level kept
  float level_ = 0;       // the first that is kept .. the last
  std::size_t fine_ = 0;  // level_ rounded down
  Place places_[2];       // in levels fine_ and fine_ + 1
};

/// KHR_texture_transform as 2 x 3 numbers: uv' = (a u + b v + c, d u + e v + f).
struct UvMatrix {
  float a = 1, b = 0, c = 0, d = 0, e = 1, f = 0;
  Vec2f place(Vec2f uv) const { return {a * uv.x + b * uv.y + c, d * uv.x + e * uv.y + f}; }
  Vec2f direction(Vec2f uv) const { return {a * uv.x + b * uv.y, d * uv.x + e * uv.y}; }
};
UvMatrix uv_matrix(const UvTransform& transform);

struct ShownMaterials {
  std::vector<RenderMaterial> materials;  // their slots count `textures`
  std::vector<RenderTexture> textures;
};

/// Textures come from the coarsest mip whose longer side has `least_side_px`, or from the full size.
/// References to texture coordinates that the mesh does not have show nothing.
ShownMaterials shown_materials(const std::vector<Material>& materials, const Fragments& fragments,
                               const std::vector<Pixels>& pixels, const Mesh& mesh,
                               std::uint32_t least_side_px, const RunContext& context);
/// The same of whole images, whose finer mips are not kept, read as their samplers say. InputError for an
/// image that does not decode.
ShownMaterials shown_materials(const std::vector<Material>& materials, const std::vector<Image>& images,
                               const Mesh& mesh, std::uint32_t least_side_px, const RunContext& context);

}  // namespace texmesh
