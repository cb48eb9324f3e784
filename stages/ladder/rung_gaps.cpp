#include "stages/ladder/rung_gaps.h"

#include <algorithm>

#include "format/base/portable_math.h"

namespace texmesh::rungs {
namespace {

constexpr int kMostSwaps = 12;

/// Whether what is left has neighbours far apart where the pair was.
bool opens_gap(const TextureWays& texture, const std::vector<std::uint8_t>& keep, std::size_t pair,
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
double gaps_of(const TextureWays& texture, const std::vector<std::uint8_t>& keep, const GivenBytes& given) {
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
double loss_of(const TextureWays& texture, const std::vector<std::uint8_t>& keep, const GivenBytes& given,
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

std::vector<std::vector<double>> units_of(const TextureWays& texture, const GivenBytes& given) {
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

bool every_level_has_one(const TextureWays& texture, const std::vector<std::uint8_t>& keep) {
  std::vector<std::uint8_t> has(texture.preview_loss.size());
  for (std::size_t k = 0; k < keep.size(); ++k) has[texture.pairs[k].level] |= keep[k];
  return std::ranges::count(has, 0) == 0;
}

}  // namespace

std::vector<std::uint8_t> gap_closers(const TextureWays& texture, const std::vector<std::uint8_t>& keep,
                                      const GivenBytes& given) {
  std::vector<std::uint8_t> out(keep.size());
  for (std::size_t level = 0; level < given.size(); ++level)
    for (std::size_t k = 0; k < keep.size() && !given[level].empty(); ++k)
      if (keep[k] && texture.pairs[k].level >= level && !out[k]) out[k] = opens_gap(texture, keep, k, level);
  return out;
}

void swap_pairs(const TextureWays& texture, const GivenBytes& given, std::vector<std::uint8_t>& keep) {
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

}  // namespace texmesh::rungs
