#pragma once
// Mutations that keep an input whole enough to get past a reader's first look.
#include <functional>

#include "tests/fuzz/fuzz_target.h"

namespace texmesh::fuzz {

/// Changes bytes in any way; the result has at most so many bytes more.
using ByteMutator = std::function<Bytes(Bytes input, std::size_t most_growth)>;

/// A small deterministic generator; the same sequence everywhere.
struct Random {
  std::uint64_t state;
  std::size_t below(std::size_t n) {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<std::size_t>((state >> 33) % n);
  }
};

/// Mutates by the target's shape. One time in eight bytes change wherever they are, and nothing is mended.
Bytes mutate(const Target& target, const Bytes& input, Random& random, const ByteMutator& change);

/// What fuzzers do, for tests without one: change, drop, repeat and splice bytes and words, and put large
/// numbers where counts and offsets may stand.
ByteMutator plain_mutator(const Target& target, const Bytes& other, Random& random);

}  // namespace texmesh::fuzz
