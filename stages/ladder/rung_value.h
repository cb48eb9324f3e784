#pragma once
// Inside the ladder only: which rungs of a texture are worth their bytes.
//
// The search looks for the smallest set of pairs (a level at a rung) that serves 1,000 simulated loads nearly
// as well as all pairs do. A load wants each texture at one level: one finer than the display has, since
// clients take it where bytes are left. A client shows one level of a texture, some fragments at one rung and
// the others at the next. So what a load gets for its bytes lies on the lower hull of loss over bytes.
// 1. Pairs that lose no less than the preview go.
// 2. Each load's bytes are shared among all textures at one price of a byte in loss x surface.
// 3. Texture by texture, one pair after the other goes: the one whose removal raises the loss least for its
//    bytes. This ends when every pair that is left is worth what LeastWorth asks and all fit in most_bytes.
// 4. Pairs stay that close gaps. Two neighbours more than kMostApart times apart in bytes leave clients
// nothing
//    to choose between them. Where most_bytes does not allow all, the least worthy of them go last, and
//    swap_pairs() tries every exchange, at most 12 rounds.
// 5. What still takes too much has cheaper pairs in the place of the last ones of levels.
// Each step removes pairs or makes them cheaper, or improves one number in a bounded number of rounds; so it
// ends.
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
struct TextureRungs {
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

/// Which pairs are worth storing, by texture and pair, 1 or 0. A pair goes while its removal raises the mean
/// loss over loads by less than `gain` times its share of TextureRungs::whole_bytes, while less than
/// `least_share` of the loads choose it, or while all pairs take more than TextureRungs::most_bytes. Fixed
/// pairs stay, and one of each level. Pairs that close gaps stay, when enough loads choose them and the finer
/// neighbour saves what somebody sees (kUnseen); this and the swaps hold where TextureRungs::closes_gaps.
/// Pure; same result anywhere.
std::vector<std::vector<std::uint8_t>> pairs_worth_storing(const std::vector<TextureRungs>& textures,
                                                           const std::vector<TextureLoad>& loads, double gain,
                                                           double least_share);

/// 1 - SSIM that nobody sees: a rung that saves half of less is not worth twice as much.
inline constexpr double kUnseen = 0.01;
/// The preview, where pairs are numbered.
inline constexpr std::size_t kPreviewPair = std::numeric_limits<std::size_t>::max();

/// A vertex of a lower hull.
struct HullVertex {
  std::size_t pair = kPreviewPair;
  double bytes = 0, loss = 0;
};
using Hull = std::vector<HullVertex>;

/// Levels of a texture, the last one included.
struct LevelRange {
  std::size_t first = 0, last = 0;
};

/// What loads give a texture: bytes, by wanted level.
using GivenBytes = std::vector<std::vector<double>>;

/// The lower hull of loss over bytes where a level is wanted: from the preview on along the kept pairs of
/// some levels.
Hull hull_of(const TextureRungs& texture, const std::vector<std::uint8_t>& keep, std::size_t wanted,
             LevelRange levels);
/// Those of the wanted level and of each coarser one.
std::vector<Hull> hulls_of(const TextureRungs& texture, const std::vector<std::uint8_t>& keep,
                           std::size_t wanted);
/// The vertex at or behind which so many bytes end.
std::size_t segment_of(const Hull& hull, double bytes);
/// Some fragments at one vertex and the others at the next one.
double loss_at(const Hull& hull, double bytes);
/// The hull that loses least with so many bytes: clients show one level of a texture.
std::size_t best_of(const std::vector<Hull>& hulls, double bytes);

/// Of all kept pairs together.
double bytes_of(const TextureRungs& texture, const std::vector<std::uint8_t>& keep);

/// Neighbours, of all pairs of any level that no other one beats in bytes and loss, have at most so many
/// times the bytes of each other, when the finer one saves more than kUnseen. Pairs above the lower hull
/// count, too: clients cannot mix levels. The preview is no neighbour.
inline constexpr double kMostApart = 2.5;

/// Pairs without which there is a gap where some level is wanted that loads want.
std::vector<std::uint8_t> gap_closing_pairs(const TextureRungs& texture,
                                            const std::vector<std::uint8_t>& keep, const GivenBytes& given);

/// Adds pairs, takes them away and puts others in their place, one at a time, as long as that makes gaps
/// smaller, or at equal gaps the mean loss of the loads. Fixed pairs stay, one of each level does, and all
/// take at most TextureRungs::most_bytes, if they did before. Same result anywhere.
void swap_pairs(const TextureRungs& texture, const GivenBytes& given, std::vector<std::uint8_t>& keep);

}  // namespace texmesh
