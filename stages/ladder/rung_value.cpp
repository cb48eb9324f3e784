#include "stages/ladder/rung_value.h"

#include "format/base/portable_math.h"
#include "format/rules/viewing.h"

namespace texmesh {

Hull hull_of(const TextureRungs& texture, const std::vector<std::uint8_t>& keep, std::size_t wanted,
             LevelRange levels) {
  Hull hull{{kPreviewPair, 0, texture.preview_loss[wanted]}};
  for (;;) {
    const HullVertex at = hull.back();
    HullVertex best;
    double steepest = 0;
    for (std::size_t k = 0; k < texture.pairs.size(); ++k) {
      const RungPair& pair = texture.pairs[k];
      if (!keep[k] || pair.level < levels.first || pair.level > levels.last) continue;
      const HullVertex to{k, static_cast<double>(pair.bytes), pair.loss[wanted]};
      if (to.bytes <= at.bytes || to.loss >= at.loss) continue;
      const double slope = (at.loss - to.loss) / (to.bytes - at.bytes);
      if (slope > steepest || (slope == steepest && to.bytes > best.bytes)) steepest = slope, best = to;
    }
    if (best.pair == kPreviewPair) return hull;
    hull.push_back(best);
  }
}

std::vector<Hull> hulls_of(const TextureRungs& texture, const std::vector<std::uint8_t>& keep,
                           std::size_t wanted) {
  std::vector<Hull> out;
  for (std::size_t level = wanted; level < texture.preview_loss.size(); ++level)
    out.push_back(hull_of(texture, keep, wanted, {level, level}));
  return out;
}

std::size_t segment_of(const Hull& hull, double bytes) {
  std::size_t k = 0;
  while (k + 1 < hull.size() && hull[k + 1].bytes <= bytes) ++k;
  return k;
}

double loss_at(const Hull& hull, double bytes) {
  const std::size_t k = segment_of(hull, bytes);
  if (k + 1 == hull.size()) return hull[k].loss;
  const HullVertex &a = hull[k], &b = hull[k + 1];
  return a.loss + (b.loss - a.loss) * ((bytes - a.bytes) / (b.bytes - a.bytes));
}

std::size_t best_of(const std::vector<Hull>& hulls, double bytes) {
  std::size_t best = 0;
  for (std::size_t k = 1; k < hulls.size(); ++k)
    if (loss_at(hulls[k], bytes) < loss_at(hulls[best], bytes)) best = k;
  return best;
}

double bytes_of(const TextureRungs& texture, const std::vector<std::uint8_t>& keep) {
  double bytes = 0;
  for (std::size_t k = 0; k < keep.size(); ++k)
    if (keep[k]) bytes += static_cast<double>(texture.pairs[k].bytes);
  return bytes;
}

namespace {

constexpr int kMostSwaps = 12;

/// Whether what is left has neighbours far apart where the pair was.
bool opens_gap(const TextureRungs& texture, const std::vector<std::uint8_t>& keep, std::size_t pair,
               std::size_t wanted) {
  const RungPair& gone = texture.pairs[pair];
  const RungPair *cheaper = nullptr, *dearer = nullptr;
  const auto loss = [&](const RungPair& p) { return p.loss[wanted]; };
  for (std::size_t k = 0; k < keep.size(); ++k) {
    const RungPair& other = texture.pairs[k];
    if (!keep[k] || k == pair || other.level < wanted || other.bytes > gone.bytes) continue;
    if (cheaper == nullptr || loss(other) < loss(*cheaper)) cheaper = &other;
  }
  if (cheaper == nullptr || loss(*cheaper) <= loss(gone)) return false;
  for (std::size_t k = 0; k < keep.size(); ++k) {
    const RungPair& other = texture.pairs[k];
    if (!keep[k] || other.level < wanted || other.bytes <= gone.bytes || loss(other) >= loss(*cheaper))
      continue;
    if (dearer == nullptr || other.bytes < dearer->bytes) dearer = &other;
  }
  return dearer != nullptr && loss(*cheaper) > loss(*dearer) + kUnseen &&
         static_cast<double>(dearer->bytes) > kMostApart * static_cast<double>(cheaper->bytes);
}

/// How far neighbours are apart beyond kMostApart: logarithms, summed over the levels that loads want.
double gaps_of(const TextureRungs& texture, const std::vector<std::uint8_t>& keep, const GivenBytes& given) {
  double sum = 0;
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < keep.size(); ++k)
    if (keep[k]) order.push_back(k);
  std::ranges::stable_sort(order, {}, [&](std::size_t k) { return texture.pairs[k].bytes; });
  for (std::size_t level = 0; level < given.size(); ++level) {
    const RungPair* before = nullptr;
    for (const std::size_t k : order) {
      const RungPair& pair = texture.pairs[k];
      if (given[level].empty() || pair.level < level) continue;
      if (before != nullptr && pair.loss[level] >= before->loss[level]) continue;
      if (before != nullptr && before->loss[level] > pair.loss[level] + kUnseen) {
        const double apart = static_cast<double>(pair.bytes) / static_cast<double>(before->bytes);
        if (apart > kMostApart) sum += portable::log(apart / kMostApart);
      }
      before = &pair;
    }
  }
  return sum;
}

/// Summed over loads, in parts of what all pairs would lose.
double loss_of(const TextureRungs& texture, const std::vector<std::uint8_t>& keep, const GivenBytes& given,
               const std::vector<std::vector<double>>& units) {
  double sum = 0;
  for (std::size_t level = 0; level < given.size(); ++level) {
    if (given[level].empty()) continue;
    const std::vector<Hull> hulls = hulls_of(texture, keep, level);
    for (std::size_t load = 0; load < given[level].size(); ++load) {
      const double bytes = given[level][load];
      sum += loss_at(hulls[best_of(hulls, bytes)], bytes) / units[level][load];
    }
  }
  return sum;
}

std::vector<std::vector<double>> units_of(const TextureRungs& texture, const GivenBytes& given) {
  const std::vector<std::uint8_t> all(texture.pairs.size(), 1);
  std::vector<std::vector<double>> out(given.size());
  for (std::size_t level = 0; level < given.size(); ++level) {
    const std::vector<Hull> hulls = hulls_of(texture, all, level);
    for (const double bytes : given[level])
      out[level].push_back(loss_at(hulls[best_of(hulls, bytes)], bytes) + kUnseen);
  }
  return out;
}

/// What a choice is worth: smaller is better, gaps first.
struct Choice {
  std::vector<std::uint8_t> keep;
  double gaps = 0, loss = 0;
  bool is_better_than(const Choice& other) const {
    constexpr double kSame = 1e-9;
    if (gaps < other.gaps - kSame) return true;
    return gaps <= other.gaps + kSame && loss < other.loss * (1 - kSame);
  }
};

bool every_level_has_one(const TextureRungs& texture, const std::vector<std::uint8_t>& keep) {
  std::vector<std::uint8_t> has(texture.preview_loss.size());
  for (std::size_t k = 0; k < keep.size(); ++k) has[texture.pairs[k].level] |= keep[k];
  return std::ranges::count(has, 0) == 0;
}

// Of a load's bytes textures have so much; mesh and tables take the rest.
constexpr double kTextureShare = 0.75;
// Prices of a byte in loss, from dear to cheap: four an octave.
constexpr int kPrices = 176, kPricesPerOctave = 4, kDearestOctave = -6;

double price(int k) {
  constexpr double kLn2 = 0.693147180559945309417;
  return portable::exp(kLn2 * (kDearestOctave - static_cast<double>(k) / kPricesPerOctave));
}

/// The level of the display has 1 to 2 texels a pixel, and this one twice as many.
std::size_t wanted_level(const TextureRungs& texture, double displayed_px) {
  std::size_t level = 0;
  while (level + 1 < texture.preview_loss.size() &&
         texture.texels_across >= displayed_px * static_cast<double>(std::uint64_t{4} << level))
    ++level;
  return level;
}

std::vector<std::uint8_t> better_than_the_preview(const TextureRungs& texture) {
  std::vector<std::uint8_t> keep;
  for (const RungPair& pair : texture.pairs)
    keep.push_back(pair.fixed || pair.loss[pair.level] < texture.preview_loss[pair.level]);
  return keep;
}

/// One pair of every level: of those that have none the best one.
void keep_one_of_each_level(const TextureRungs& texture, std::vector<std::uint8_t>& keep) {
  for (std::size_t level = 0; level < texture.preview_loss.size(); ++level) {
    std::size_t best = kPreviewPair;
    bool any = false;
    for (std::size_t k = 0; k < keep.size(); ++k) {
      const RungPair& pair = texture.pairs[k];
      if (pair.level != level) continue;
      any = any || keep[k];
      if (best == kPreviewPair || pair.loss[level] < texture.pairs[best].loss[level]) best = k;
    }
    if (!any && best != kPreviewPair) keep[best] = 1;
  }
}

/// The bytes that a texture takes where a level is wanted, by price.
using BytesByPrice = std::array<double, kPrices>;

BytesByPrice bytes_by_price(const TextureRungs& texture, const std::vector<std::uint8_t>& keep,
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
std::vector<GivenBytes> share_loads(const std::vector<TextureRungs>& textures,
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
struct PairWorth {
  double loads = 0;  // that choose it
  double rise = 0;   // of the loss without it, summed over loads, in parts of the whole ladder's loss
};

/// The hulls of a texture where a level is wanted.
struct LevelHulls {
  std::vector<Hull> hulls;                 // of each level
  std::vector<std::vector<Hull>> without;  // the same without that vertex, by hull and vertex
};

LevelHulls level_hulls(const TextureRungs& texture, const std::vector<std::uint8_t>& keep,
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
std::vector<PairWorth> worth_of(const TextureRungs& texture, const std::vector<std::uint8_t>& keep,
                                const GivenBytes& given, const std::vector<std::vector<Hull>>& whole) {
  std::vector<PairWorth> out(texture.pairs.size());
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
        PairWorth& worth = out[hull[v].pair];
        worth.loads += 1;
        worth.rise += (loss_without(now, h, v, bytes) - loss) / unit;
      }
    }
  }
  return out;
}

/// What is asked of a pair.
struct LeastWorth {
  double loads = 0;          // that choose it
  double rise_per_byte = 0;  // PairWorth::rise
};

/// The pair to go next; kPreviewPair for none. Fixed pairs and the last one of every level stay, and those of
/// `gap_closing` as long as another one can go.
std::size_t next_to_go(const TextureRungs& texture, const std::vector<std::uint8_t>& keep,
                       const std::vector<std::uint8_t>& gap_closing, const std::vector<PairWorth>& worth,
                       const LeastWorth& least_worth) {
  std::vector<std::size_t> of_level(texture.preview_loss.size());
  for (std::size_t k = 0; k < keep.size(); ++k) of_level[texture.pairs[k].level] += keep[k];
  const bool too_much = bytes_of(texture, keep) > texture.most_bytes;
  std::size_t next = kPreviewPair;
  bool next_closes = false;
  double least = 0;
  for (std::size_t k = 0; k < keep.size(); ++k) {
    const RungPair& pair = texture.pairs[k];
    if (!keep[k] || pair.fixed || of_level[pair.level] < 2) continue;
    const double per_byte = worth[k].rise / static_cast<double>(std::max<std::uint64_t>(pair.bytes, 1));
    const bool chosen = worth[k].loads >= least_worth.loads, closes = chosen && gap_closing[k];
    if (!too_much && (closes || (chosen && per_byte >= least_worth.rise_per_byte))) continue;
    if (next != kPreviewPair && (closes > next_closes || (closes == next_closes && per_byte >= least)))
      continue;
    next = k, next_closes = closes, least = per_byte;
  }
  return next;
}

/// Where all still take too much, since the last pair of a level stays: cheaper pairs in the place of such
/// ones, those first that lose least for the bytes they save. What a sample says of bytes is some hundredths
/// off.
void take_cheaper(const TextureRungs& texture, std::vector<std::uint8_t>& keep) {
  constexpr double kRoom = 0.97;
  while (bytes_of(texture, keep) > texture.most_bytes) {
    std::size_t out = kPreviewPair, in = kPreviewPair;
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
        if (in == kPreviewPair || per_byte < least) out = k, in = c, least = per_byte;
      }
    if (in == kPreviewPair) return;
    keep[out] = 0, keep[in] = 1;
  }
}

/// `keep` of one texture without what is not worth its bytes.
void drop_pairs(const TextureRungs& texture, const GivenBytes& given, const LeastWorth& least_worth,
                std::vector<std::uint8_t>& keep) {
  std::vector<std::vector<Hull>> whole;
  for (std::size_t level = 0; level < given.size(); ++level) whole.push_back(hulls_of(texture, keep, level));
  bool bound = false;
  const auto drop = [&] {
    for (;;) {
      const std::vector<std::uint8_t> gap_closing = texture.closes_gaps
                                                        ? gap_closing_pairs(texture, keep, given)
                                                        : std::vector<std::uint8_t>(keep.size());
      const std::size_t next =
          next_to_go(texture, keep, gap_closing, worth_of(texture, keep, given, whole), least_worth);
      if (next == kPreviewPair) return;
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

std::vector<std::uint8_t> gap_closing_pairs(const TextureRungs& texture,
                                            const std::vector<std::uint8_t>& keep, const GivenBytes& given) {
  std::vector<std::uint8_t> out(keep.size());
  for (std::size_t level = 0; level < given.size(); ++level)
    for (std::size_t k = 0; k < keep.size() && !given[level].empty(); ++k)
      if (keep[k] && texture.pairs[k].level >= level && !out[k]) out[k] = opens_gap(texture, keep, k, level);
  return out;
}

void swap_pairs(const TextureRungs& texture, const GivenBytes& given, std::vector<std::uint8_t>& keep) {
  const std::vector<std::vector<double>> units = units_of(texture, given);
  const double most = std::max(texture.most_bytes, bytes_of(texture, keep));
  Choice best{keep, gaps_of(texture, keep, given), loss_of(texture, keep, given, units)};
  for (int swap = 0; swap < kMostSwaps; ++swap) {
    const std::vector<std::uint8_t> from = best.keep;
    const auto consider = [&](const std::vector<std::uint8_t>& choice) {
      if (bytes_of(texture, choice) > most || !every_level_has_one(texture, choice)) return;
      Choice next{choice, gaps_of(texture, choice, given), best.loss};
      if (next.gaps > best.gaps) return;
      next.loss = loss_of(texture, choice, given, units);
      if (next.is_better_than(best)) best = std::move(next);
    };
    for (std::size_t in = 0; in < from.size(); ++in) {
      if (from[in]) continue;
      std::vector<std::uint8_t> choice = from;
      choice[in] = 1;
      consider(choice);
      for (std::size_t out = 0; out < from.size(); ++out) {
        if (!from[out] || texture.pairs[out].fixed) continue;
        choice[out] = 0;
        consider(choice);
        choice[out] = 1;
      }
    }
    if (best.keep == from) break;
  }
  keep = best.keep;
}

std::vector<TextureLoad> texture_loads() {
  std::vector<TextureLoad> out;
  for (const OrdinaryLoad& load : ordinary_loads())
    out.push_back({load.displayed_px, kTextureShare * load.bytes_s * load.time_limit_s});
  return out;
}

std::vector<std::vector<std::uint8_t>> pairs_worth_storing(const std::vector<TextureRungs>& textures,
                                                           const std::vector<TextureLoad>& loads, double gain,
                                                           double least_share) {
  std::vector<std::vector<std::uint8_t>> keep;
  for (const TextureRungs& texture : textures) {
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
