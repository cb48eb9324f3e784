#pragma once
// Inside the ladder only: which ways of storing a texture are worth their bytes.
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace texmesh {

/// One way to store a texture: a plane of the chain (0 = full size, 1 = its first mip, ...) at one rung.
struct RungPair {
  std::size_t level = 0, rung = 0;
  std::uint64_t bytes = 0;   // of all the rung's streams and its tables
  std::vector<double> loss;  // [level + 1]: surface-weighted 1 - SSIM where the display shows that level
  bool fixed = false;        // is stored whatever it is worth
};

/// A texture as loads meet it.
struct TextureWays {
  double surface = 0;                // share of the object's surface that shows it
  double texels_across = 0;          // of full size, along the height of an object that looks like a ball
  std::vector<double> preview_loss;  // [levels], as RungPair::loss; the preview takes no bytes
  std::vector<RungPair> pairs;       // by (level, rung)
  std::uint64_t whole_bytes = 0;     // by which pairs are judged; 0: those of the largest pair
  double most_bytes = std::numeric_limits<double>::infinity();  // that all stored pairs may take together
  bool closes_gaps = true;  // whether pairs stay, and are swapped, because neighbours are far apart
};

/// What a load is to textures.
struct TextureLoad {
  double displayed_px = 0;  // height of the object
  double bytes = 0;         // that textures may take
};

/// Of ordinary_loads() (format/rules).
std::vector<TextureLoad> texture_loads();

/// Which pairs are worth storing, by texture and pair, 1 or 0. In every load each texture is wanted at one
/// level finer than the display has, which clients take where bytes are left, and is shown by one level, that
/// or a coarser one: along the lower hull of loss over bytes of its pairs, which begins at the preview, some
/// fragments at one vertex, the others at the next one. The load's bytes are shared at one price, in
/// loss x surface, for all textures. First the pairs go that lose no less than the preview. Then, one by one,
/// that pair goes whose removal raises the loss least for its bytes, while the removal raises the mean over
/// loads by less than `gain` times the pair's share of TextureWays::whole_bytes, or while less than
/// `least_share` of the loads choose the pair, or while all pairs take more than TextureWays::most_bytes.
/// Fixed pairs stay, and one of each level. A pair stays, too, that enough loads choose and without which two
/// neighbours, of all that no other pair beats in bytes and loss, would be more than 2.5 times apart in
/// bytes, when the finer one of them saves what somebody sees. Where all take too much the least worthy of
/// these go, as the last ones; then such a texture's pairs are swapped (swap_pairs() of rung_gaps.h). Both
/// only where TextureWays::closes_gaps. What then still takes too much has cheaper pairs in the place of the
/// last ones of levels. Pure; same result anywhere.
std::vector<std::vector<std::uint8_t>> pairs_worth_storing(const std::vector<TextureWays>& textures,
                                                           const std::vector<TextureLoad>& loads, double gain,
                                                           double least_share);

}  // namespace texmesh
