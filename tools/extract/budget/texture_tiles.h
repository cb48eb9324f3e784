#pragma once

#include "stages/fill/fill.h"
#include "tools/extract/budget/reference.h"

namespace texmesh {

/// Where windows read an image: places in 0..1 after the slots' transforms and wraps, one for each fragment
/// of the pictures that reads it.
std::vector<Vec2f> places_read(const LitViews& windows, const std::vector<PictureTexture>& shown,
                               std::size_t image);

/// An image at one size, for files of it that are only to be looked at in windows. JPEGs code blocks of
/// 8 x 8 or 16 x 16 apart, so the squares that the windows read show what a whole file would show there, and
/// a sample of all squares tells how many bytes it would have. Both take a tenth of the time and less.
class TextureTiles {
 public:
  static constexpr std::uint32_t kTilePx = 16;
  /// Whether an image of this size is worth it, and can be cut up so that its smaller copies can, too.
  static bool suits(std::uint32_t width_px, std::uint32_t height_px);

  /// `coverage`: the texels that the mesh shows; what others hold becomes cheap to code in the squares.
  /// `reach_px`: how far around a place a pixel reads, in texels of this size. `image` must stay where it is.
  TextureTiles(const Pixels& image, const std::vector<std::uint8_t>& coverage,
               const std::vector<Vec2f>& places, double reach_px, const RunContext& context);

  /// The squares that are read, as a picture of their own; of an image that nothing reads, one square.
  const Pixels& read_tiles() const { return read_tiles_; }
  /// Squares spread evenly over the image, about a quarter of a million texels.
  const Pixels& sample() const { return sample_; }
  /// Bytes of the whole image's file, by those of the sample's.
  double file_bytes(std::size_t sample_bytes) const;

  /// Before texture_with() of this kind: levels finer than `first_level` are not kept.
  void prepare(bool srgb, std::uint32_t first_level, const RunContext& context);
  /// The texture of the image with the squares that are read as `tiles` has them, the picture of
  /// read_tiles() after its coding. Levels of more than kTilePx texels a texel stay as the image has them.
  RenderTexture texture_with(Pixels tiles, bool srgb, const RunContext& context) const;

 private:
  using Tile = Vec2<std::uint32_t>;  // its column and row
  void find_tiles(const std::vector<Vec2f>& places, double reach_px);
  std::vector<Tile> spread_tiles() const;
  Pixels picture_of(const std::vector<Tile>& tiles, std::uint32_t side_px,
                    const std::vector<std::uint8_t>& coverage, PartBlocks part,
                    const RunContext& context) const;
  const Pixels& image_;
  std::vector<Tile> tiles_;
  Pixels read_tiles_, sample_;
  double sampled_ = 1;                   // of the image's texels
  std::map<bool, RenderTexture> whole_;  // by srgb
};

}  // namespace texmesh
