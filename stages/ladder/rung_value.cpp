#include "stages/ladder/rung_value.h"

#include <algorithm>
#include <array>
#include <limits>

#include "format/base/portable_math.h"
#include "format/rules/ordinary_loads.h"
#include "stages/ladder/rung_gaps.h"
#include "stages/ladder/rung_hull.h"

namespace texmesh {
namespace {

using rungs::best_of;
using rungs::bytes_of;
using rungs::gap_closers;
using rungs::GivenBytes;
using rungs::Hull;
using rungs::hull_of;
using rungs::hulls_of;
using rungs::kPreview;
using rungs::kUnseen;
using rungs::loss_at;
using rungs::segment_of;
using rungs::swap_pairs;

// Of a load's bytes textures have so much; mesh and tables take the rest.
constexpr double kTextureShare = 0.75;
// Prices of a byte in loss, from dear to cheap: four an octave.
constexpr int kPrices = 176, kPricesPerOctave = 4, kDearestOctave = -6;

double price(int k) {
  constexpr double kLn2 = 0.693147180559945309417;
  return portable::exp(kLn2 * (kDearestOctave - static_cast<double>(k) / kPricesPerOctave));
}

/// The level of the display has 1 to 2 texels a pixel, and this one twice as many.
std::size_t wanted_level(const TextureWays& texture, double displayed_px) {
  std::size_t level = 0;
  while (level + 1 < texture.preview_loss.size() &&
         texture.texels_across >= displayed_px * static_cast<double>(std::uint64_t{4} << level))
    ++level;
  return level;
}

std::vector<std::uint8_t> better_than_the_preview(const TextureWays& texture) {
  std::vector<std::uint8_t> keep;
  for (const RungPair& pair : texture.pairs)
    keep.push_back(pair.fixed || pair.loss[pair.level] < texture.preview_loss[pair.level]);
  return keep;
}

/// One pair of every level: of those that have none the best one.
void keep_one_of_each_level(const TextureWays& texture, std::vector<std::uint8_t>& keep) {
  for (std::size_t level = 0; level < texture.preview_loss.size(); ++level) {
    std::size_t best = kPreview;
    bool any = false;
    for (std::size_t k = 0; k < keep.size(); ++k) {
      const RungPair& pair = texture.pairs[k];
      if (pair.level != level) continue;
      any = any || keep[k];
      if (best == kPreview || pair.loss[level] < texture.pairs[best].loss[level]) best = k;
    }
    if (!any && best != kPreview) keep[best] = 1;
  }
}

/// The bytes that a texture takes where a level is wanted, by price.
using BytesByPrice = std::array<double, kPrices>;

BytesByPrice bytes_by_price(const TextureWays& texture, const std::vector<std::uint8_t>& keep,
                            std::size_t level) {
  const Hull hull = hull_of(texture, keep, level, {level, texture.preview_loss.size() - 1});
  BytesByPrice out{};
  std::size_t at = 0;
  for (std::size_t k = 0; k < kPrices; ++k) {
    while (at + 1 < hull.size() && texture.surface * (hull[at].loss - hull[at + 1].loss) >=
                                       price(static_cast<int>(k)) * (hull[at + 1].bytes - hull[at].bytes))
      ++at;
    out[k] = hull[at].bytes;
  }
  return out;
}

/// By texture. Where one price takes less than a load has and the next one more, every texture goes the same
/// part of its way between them.
std::vector<GivenBytes> share_loads(const std::vector<TextureWays>& textures,
                                    const std::vector<std::vector<std::uint8_t>>& keep,
                                    const std::vector<TextureLoad>& loads) {
  std::vector<std::vector<BytesByPrice>> bytes(textures.size());
  std::vector<GivenBytes> given(textures.size());
  for (std::size_t t = 0; t < textures.size(); ++t) {
    given[t].resize(textures[t].preview_loss.size());
    for (std::size_t level = 0; level < given[t].size(); ++level)
      bytes[t].push_back(bytes_by_price(textures[t], keep[t], level));
  }
  std::vector<std::size_t> level(textures.size());
  for (const TextureLoad& load : loads) {
    for (std::size_t t = 0; t < level.size(); ++t) level[t] = wanted_level(textures[t], load.displayed_px);
    const auto taken = [&](std::size_t k) {
      double sum = 0;
      for (std::size_t t = 0; t < level.size(); ++t) sum += bytes[t][level[t]][k];
      return sum;
    };
    std::size_t k = 0;
    double now = taken(0), next = now;
    for (; k + 1 < kPrices; ++k, now = next) {
      next = taken(k + 1);
      if (next > load.bytes) break;
    }
    const std::size_t to = std::min<std::size_t>(k + 1, kPrices - 1);
    const double part = next > now ? std::max(0.0, load.bytes - now) / (next - now) : 0;
    for (std::size_t t = 0; t < level.size(); ++t) {
      const BytesByPrice& own = bytes[t][level[t]];
      given[t][level[t]].push_back(own[k] + part * (own[to] - own[k]));
    }
  }
  return given;
}

/// What a pair is to the loads.
struct Worth {
  double loads = 0;  // that choose it
  double rise = 0;   // of the loss without it, summed over loads, in parts of the whole ladder's loss
};

/// The hulls of a texture where a level is wanted.
struct LevelHulls {
  std::vector<Hull> hulls;                 // of each level
  std::vector<std::vector<Hull>> without;  // the same without that vertex, by hull and vertex
};

LevelHulls level_hulls(const TextureWays& texture, const std::vector<std::uint8_t>& keep,
                       std::size_t wanted) {
  LevelHulls out{hulls_of(texture, keep, wanted), {}};
  for (std::size_t h = 0; h < out.hulls.size(); ++h) {
    std::vector<Hull>& without = out.without.emplace_back(out.hulls[h].size());
    for (std::size_t v = 1; v < without.size(); ++v) {
      std::vector<std::uint8_t> others = keep;
      others[out.hulls[h][v].pair] = 0;
      without[v] = hull_of(texture, others, wanted, {wanted + h, wanted + h});
    }
  }
  return out;
}

/// The loss of so many bytes without a vertex of a hull.
double loss_without(const LevelHulls& at, std::size_t hull, std::size_t vertex, double bytes) {
  double least = loss_at(at.without[hull][vertex], bytes);
  for (std::size_t h = 0; h < at.hulls.size(); ++h)
    if (h != hull) least = std::min(least, loss_at(at.hulls[h], bytes));
  return least;
}

/// `whole`: the texture's hulls with all pairs, by wanted level.
std::vector<Worth> worth_of(const TextureWays& texture, const std::vector<std::uint8_t>& keep,
                            const GivenBytes& given, const std::vector<std::vector<Hull>>& whole) {
  std::vector<Worth> out(texture.pairs.size());
  for (std::size_t level = 0; level < given.size(); ++level) {
    if (given[level].empty()) continue;
    const LevelHulls now = level_hulls(texture, keep, level);
    for (const double bytes : given[level]) {
      const std::size_t h = best_of(now.hulls, bytes);
      const Hull& hull = now.hulls[h];
      const double loss = loss_at(hull, bytes),
                   unit = loss_at(whole[level][best_of(whole[level], bytes)], bytes) + kUnseen;
      const std::size_t k = segment_of(hull, bytes), last = std::min(k + 1, hull.size() - 1);
      for (std::size_t v = std::max<std::size_t>(k, 1); v <= last; ++v) {
        if (v > k && bytes <= hull[k].bytes) continue;  // all fragments are at the vertex before
        Worth& worth = out[hull[v].pair];
        worth.loads += 1;
        worth.rise += (loss_without(now, h, v, bytes) - loss) / unit;
      }
    }
  }
  return out;
}

/// What is asked of a pair.
struct Asked {
  double loads = 0;          // that choose it
  double rise_per_byte = 0;  // Worth::rise
};

/// The pair to go next; kPreview for none. Fixed pairs and the last one of every level stay, and those of
/// `closers` as long as another one can go.
std::size_t next_to_go(const TextureWays& texture, const std::vector<std::uint8_t>& keep,
                       const std::vector<std::uint8_t>& closers, const std::vector<Worth>& worth,
                       const Asked& asked) {
  std::vector<std::size_t> of_level(texture.preview_loss.size());
  for (std::size_t k = 0; k < keep.size(); ++k) of_level[texture.pairs[k].level] += keep[k];
  const bool too_much = bytes_of(texture, keep) > texture.most_bytes;
  std::size_t next = kPreview;
  bool next_closes = false;
  double least = 0;
  for (std::size_t k = 0; k < keep.size(); ++k) {
    const RungPair& pair = texture.pairs[k];
    if (!keep[k] || pair.fixed || of_level[pair.level] < 2) continue;
    const double per_byte = worth[k].rise / static_cast<double>(std::max<std::uint64_t>(pair.bytes, 1));
    const bool chosen = worth[k].loads >= asked.loads, closes = chosen && closers[k];
    if (!too_much && (closes || (chosen && per_byte >= asked.rise_per_byte))) continue;
    if (next != kPreview && (closes > next_closes || (closes == next_closes && per_byte >= least))) continue;
    next = k, next_closes = closes, least = per_byte;
  }
  return next;
}

/// Where all still take too much, since the last pair of a level stays: cheaper pairs in the place of such
/// ones, those first that lose least for the bytes they save. What a sample says of bytes is some hundredths
/// off.
void take_cheaper(const TextureWays& texture, std::vector<std::uint8_t>& keep) {
  constexpr double kRoom = 0.97;
  while (bytes_of(texture, keep) > texture.most_bytes) {
    std::size_t out = kPreview, in = kPreview;
    double least = 0;
    for (std::size_t k = 0; k < keep.size(); ++k)
      for (std::size_t c = 0; c < keep.size(); ++c) {
        const RungPair &dear = texture.pairs[k], &cheap = texture.pairs[c];
        if (!keep[k] || dear.fixed || keep[c] || cheap.level != dear.level || cheap.bytes >= dear.bytes ||
            cheap.loss[cheap.level] >= texture.preview_loss[cheap.level])
          continue;
        const auto saved = static_cast<double>(dear.bytes - cheap.bytes);
        const double enough = bytes_of(texture, keep) - kRoom * texture.most_bytes;
        const double rise = std::max(cheap.loss[cheap.level] - dear.loss[dear.level], 0.0);
        const double per_byte = (rise + kUnseen) / std::min(saved, enough);
        if (in == kPreview || per_byte < least) out = k, in = c, least = per_byte;
      }
    if (in == kPreview) return;
    keep[out] = 0, keep[in] = 1;
  }
}

/// `keep` of one texture without what is not worth its bytes.
void drop_pairs(const TextureWays& texture, const GivenBytes& given, const Asked& asked,
                std::vector<std::uint8_t>& keep) {
  std::vector<std::vector<Hull>> whole;
  for (std::size_t level = 0; level < given.size(); ++level) whole.push_back(hulls_of(texture, keep, level));
  bool bound = false;
  const auto drop = [&] {
    for (;;) {
      const std::vector<std::uint8_t> closers =
          texture.closes_gaps ? gap_closers(texture, keep, given) : std::vector<std::uint8_t>(keep.size());
      const std::size_t next =
          next_to_go(texture, keep, closers, worth_of(texture, keep, given, whole), asked);
      if (next == kPreview) return;
      bound = bound || bytes_of(texture, keep) > texture.most_bytes;
      keep[next] = 0;
    }
  };
  drop();
  if (bound && texture.closes_gaps) {
    swap_pairs(texture, given, keep);
    drop();
  }
  take_cheaper(texture, keep);
}

}  // namespace

std::vector<TextureLoad> texture_loads() {
  std::vector<TextureLoad> out;
  for (const OrdinaryLoad& load : ordinary_loads())
    out.push_back({load.displayed_px, kTextureShare * load.bytes_s * load.time_limit_s});
  return out;
}

std::vector<std::vector<std::uint8_t>> pairs_worth_storing(const std::vector<TextureWays>& textures,
                                                           const std::vector<TextureLoad>& loads, double gain,
                                                           double least_share) {
  std::vector<std::vector<std::uint8_t>> keep;
  for (const TextureWays& texture : textures) {
    keep.push_back(better_than_the_preview(texture));
    keep_one_of_each_level(texture, keep.back());
  }
  const std::vector<GivenBytes> given = share_loads(textures, keep, loads);
  const auto count = static_cast<double>(loads.size());
  for (std::size_t t = 0; t < textures.size(); ++t) {
    std::uint64_t most = std::max<std::uint64_t>(textures[t].whole_bytes, 1);
    if (textures[t].whole_bytes == 0)
      for (const RungPair& pair : textures[t].pairs) most = std::max(most, pair.bytes);
    drop_pairs(textures[t], given[t], {least_share * count, gain * count / static_cast<double>(most)},
               keep[t]);
  }
  return keep;
}

}  // namespace texmesh
