#include "stages/ladder/rung_value.h"

#include <algorithm>
#include <array>
#include <limits>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

// Of a load's bytes textures have so much; mesh and tables take the rest.
constexpr double kTextureShare = 0.75;
// 1 - SSIM that nobody sees: a rung that saves half of less is not worth twice as much.
constexpr double kUnseen = 0.01;
// Prices of a byte in loss, from dear to cheap: four an octave.
constexpr int kPrices = 176, kPricesPerOctave = 4, kDearestOctave = -6;

double price(int k) {
  constexpr double kLn2 = 0.693147180559945309417;
  return portable::exp(kLn2 * (kDearestOctave - static_cast<double>(k) / kPricesPerOctave));
}

/// Numbers in 0..1 by SplitMix64 (Steele, Lea, Flood 2014).
class Draws {
 public:
  double next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15ull);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return static_cast<double>((z ^ (z >> 31)) >> 11) / 9007199254740992.0;
  }
  double between(double least, double most) {
    return least * portable::exp(next() * portable::log(most / least));
  }

 private:
  std::uint64_t state_ = 18;
};

/// Where a texture is wanted at one level and one price.
struct Cell {
  std::size_t level = 0;
  double price = 0;
  double loads = 0;  // how many
};

constexpr std::size_t kPreview = std::numeric_limits<std::size_t>::max();

/// The best way in a cell, and how much worse the second best is.
struct Best {
  std::size_t pair = kPreview;
  double loss = 0, cost = 0, rise = 0;
};

Best best_way(const TextureWays& texture, const std::vector<std::uint8_t>& keep, std::size_t level,
              double price) {
  Best best{kPreview, texture.preview_loss[level], texture.preview_loss[level], 0};
  double second = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < texture.pairs.size(); ++k) {
    const RungPair& pair = texture.pairs[k];
    if (!keep[k] || pair.level < level) continue;
    const double cost = pair.loss[level] + price * static_cast<double>(pair.bytes);
    if (cost < best.cost) {
      second = best.cost;
      best.pair = k, best.loss = pair.loss[level], best.cost = cost;
    } else {
      second = std::min(second, cost);
    }
  }
  best.rise = second - best.cost;
  return best;
}

std::size_t wanted_level(const TextureWays& texture, double displayed_px) {
  std::size_t level = 0;
  while (level + 1 < texture.preview_loss.size() &&
         texture.texels_across >= displayed_px * static_cast<double>(std::uint64_t{2} << level))
    ++level;
  return level;
}

/// The price of a byte as it looks to one texture, whose loss counts by its surface.
double own_price(const TextureWays& texture, int k) { return price(k) / std::max(texture.surface, 1e-9); }

std::vector<std::uint8_t> better_than_the_preview(const TextureWays& texture) {
  std::vector<std::uint8_t> keep;
  for (const RungPair& pair : texture.pairs)
    keep.push_back(pair.fixed || pair.loss[pair.level] < texture.preview_loss[pair.level]);
  return keep;
}

/// Bytes that textures take, by texture, wanted level and price.
using BytesByPrice = std::array<double, kPrices>;
std::vector<std::vector<BytesByPrice>> bytes_by_price(const std::vector<TextureWays>& textures,
                                                      const std::vector<std::vector<std::uint8_t>>& keep) {
  std::vector<std::vector<BytesByPrice>> out;
  for (std::size_t t = 0; t < textures.size(); ++t) {
    auto& levels = out.emplace_back(textures[t].preview_loss.size());
    for (std::size_t level = 0; level < levels.size(); ++level)
      for (int k = 0; k < kPrices; ++k) {
        const Best best = best_way(textures[t], keep[t], level, own_price(textures[t], k));
        levels[level][static_cast<std::size_t>(k)] =
            best.pair == kPreview ? 0 : static_cast<double>(textures[t].pairs[best.pair].bytes);
      }
  }
  return out;
}

/// The cells of every texture, those with loads only.
std::vector<std::vector<Cell>> cells_of(const std::vector<TextureWays>& textures,
                                        const std::vector<std::vector<std::uint8_t>>& keep,
                                        const std::vector<SimulatedLoad>& loads) {
  const auto bytes = bytes_by_price(textures, keep);
  std::vector<std::vector<BytesByPrice>> counts(bytes.size());
  for (std::size_t t = 0; t < bytes.size(); ++t) counts[t].assign(bytes[t].size(), BytesByPrice{});
  std::vector<std::size_t> level(textures.size());
  for (const SimulatedLoad& load : loads) {
    for (std::size_t t = 0; t < level.size(); ++t) level[t] = wanted_level(textures[t], load.displayed_px);
    const auto taken = [&](std::size_t k) {
      double sum = 0;
      for (std::size_t t = 0; t < level.size(); ++t) sum += bytes[t][level[t]][k];
      return sum;
    };
    std::size_t k = 0;
    while (k + 1 < kPrices && taken(k + 1) <= load.bytes) ++k;
    for (std::size_t t = 0; t < level.size(); ++t) ++counts[t][level[t]][k];
  }
  std::vector<std::vector<Cell>> cells(textures.size());
  for (std::size_t t = 0; t < textures.size(); ++t)
    for (std::size_t l = 0; l < counts[t].size(); ++l)
      for (std::size_t k = 0; k < kPrices; ++k)
        if (counts[t][l][k] > 0)
          cells[t].push_back({l, own_price(textures[t], static_cast<int>(k)), counts[t][l][k]});
  return cells;
}

/// What a pair is to the loads.
struct Worth {
  double loads = 0;  // that choose it
  double rise = 0;   // of the loss without it, summed over loads, in parts of the whole ladder's loss
};

std::vector<Worth> worth_of(const TextureWays& texture, const std::vector<std::uint8_t>& keep,
                            const std::vector<Cell>& cells, const std::vector<double>& whole_loss) {
  std::vector<Worth> out(texture.pairs.size());
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const Best best = best_way(texture, keep, cells[c].level, cells[c].price);
    if (best.pair == kPreview) continue;
    out[best.pair].loads += cells[c].loads;
    out[best.pair].rise += cells[c].loads * best.rise / (whole_loss[c] + kUnseen);
  }
  return out;
}

/// What is asked of a pair.
struct Asked {
  double loads = 0;          // that choose it
  double rise_per_byte = 0;  // Worth::rise
};

/// The pair to go next; kPreview for none. `alone` pairs, the last ones of their levels, and fixed ones stay.
std::size_t next_to_go(const TextureWays& texture, const std::vector<std::uint8_t>& keep,
                       const std::vector<Worth>& worth, const Asked& asked) {
  std::vector<std::size_t> of_level(texture.preview_loss.size());
  for (std::size_t k = 0; k < keep.size(); ++k) of_level[texture.pairs[k].level] += keep[k];
  std::size_t next = kPreview;
  double least = 0;
  for (std::size_t k = 0; k < keep.size(); ++k) {
    const RungPair& pair = texture.pairs[k];
    if (!keep[k] || pair.fixed || of_level[pair.level] < 2) continue;
    const double per_byte = worth[k].rise / static_cast<double>(std::max<std::uint64_t>(pair.bytes, 1));
    if (worth[k].loads >= asked.loads && per_byte >= asked.rise_per_byte) continue;
    if (next == kPreview || per_byte < least) next = k, least = per_byte;
  }
  return next;
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

}  // namespace

std::vector<SimulatedLoad> simulated_loads(std::size_t count) {
  std::vector<SimulatedLoad> out;
  Draws draws;
  for (std::size_t k = 0; k < count; ++k) {
    const double bytes_s = draws.between(2e6, 50e6) / 8, displayed_px = draws.between(200, 2000);
    out.push_back({displayed_px, kTextureShare * bytes_s * draws.between(1, 10)});
  }
  return out;
}

std::vector<std::vector<std::uint8_t>> pairs_worth_storing(const std::vector<TextureWays>& textures,
                                                           const std::vector<SimulatedLoad>& loads,
                                                           double gain, double least_share) {
  std::vector<std::vector<std::uint8_t>> keep;
  for (const TextureWays& texture : textures) {
    keep.push_back(better_than_the_preview(texture));
    keep_one_of_each_level(texture, keep.back());
  }
  const auto cells = cells_of(textures, keep, loads);
  const auto count = static_cast<double>(loads.size());
  for (std::size_t t = 0; t < textures.size(); ++t) {
    const TextureWays& texture = textures[t];
    std::vector<double> whole_loss;
    for (const Cell& cell : cells[t])
      whole_loss.push_back(best_way(texture, keep[t], cell.level, cell.price).loss);
    std::uint64_t most = 1;
    for (const RungPair& pair : texture.pairs) most = std::max(most, pair.bytes);
    const Asked asked{least_share * count, gain * count / static_cast<double>(most)};
    for (;;) {
      const std::size_t next =
          next_to_go(texture, keep[t], worth_of(texture, keep[t], cells[t], whole_loss), asked);
      if (next == kPreview) break;
      keep[t][next] = 0;
    }
  }
  return keep;
}

}  // namespace texmesh
