// Replays the fuzz target (tests/fuzz/format_fuzz.h) over its corpus and over mutations of it; the target
// aborts where a reader does anything but answer or throw FormatError.
#include <gtest/gtest.h>

#include <algorithm>

#include "format/base/bytes.h"
#include "tests/fuzz/format_fuzz.h"

namespace texmesh {
namespace {

struct Random {
  std::uint64_t state;
  std::size_t below(std::size_t n) {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<std::size_t>((state >> 33) % n);
  }
};

/// What fuzzers do: change, drop, repeat and splice bytes, and put numbers where counts and offsets stand.
Bytes mutate(Bytes input, const Bytes& other, Random& random) {
  for (std::size_t round = 0, rounds = 1 + random.below(4); round < rounds; ++round) {
    if (input.size() < 2) break;
    const std::size_t at = 1 + random.below(input.size() - 1);
    const auto begin = input.begin() + static_cast<std::ptrdiff_t>(at);
    const auto end = begin + static_cast<std::ptrdiff_t>(1 + random.below(input.size() - at));
    switch (random.below(6)) {
      case 0:
        input[at] = static_cast<std::uint8_t>(random.below(256));
        break;
      case 1:
        input.erase(begin, end);
        break;
      case 2:
        input.insert(begin, 1 + random.below(9), static_cast<std::uint8_t>(random.below(2) * 255));
        break;
      case 3: {
        const Bytes part(begin, end);
        input.insert(begin, part.begin(), part.end());
        break;
      }
      case 4:
        std::copy_n(other.begin(), std::min(other.size(), input.size() - at), begin);
        break;
      default:
        std::fill(begin, begin + static_cast<std::ptrdiff_t>(std::min<std::size_t>(4, input.size() - at)),
                  0xff);
    }
  }
  return input;
}

TEST(FormatFuzz, CorpusIsWellFormed) {
  const auto corpus = fuzz::make_corpus();
  EXPECT_GE(corpus.size(), 20u);
  for (const Bytes& input : corpus) fuzz::read_format(input);
}

TEST(FormatFuzz, MutationsOfTheCorpus) {
  const auto corpus = fuzz::make_corpus();
  Random random{2024};
  for (int round = 0; round < 600; ++round)
    for (const Bytes& input : corpus)
      fuzz::read_format(mutate(input, corpus[random.below(corpus.size())], random));
}

}  // namespace
}  // namespace texmesh
