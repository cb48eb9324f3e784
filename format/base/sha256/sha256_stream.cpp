#include "format/base/sha256/sha256_stream.h"

#include <algorithm>

#include "format/base/sha256/sha256_blocks.h"

namespace texmesh {

void Sha256Stream::add(std::span<const std::uint8_t> piece) {
  const auto begun = static_cast<std::size_t>(bytes_ % kBlockBytes);
  bytes_ += piece.size();
  if (begun > 0) {
    const std::size_t taken = std::min(piece.size(), kBlockBytes - begun);
    std::copy_n(piece.begin(), taken, begun_.begin() + static_cast<std::ptrdiff_t>(begun));
    piece = piece.subspan(taken);
    if (begun + taken < kBlockBytes) return;
    add_sha256_blocks(state_, begun_.data(), 1);
  }
  const std::size_t blocks = piece.size() / kBlockBytes;
  if (blocks > 0) add_sha256_blocks(state_, piece.data(), blocks);
  std::ranges::copy(piece.subspan(blocks * kBlockBytes), begun_.begin());
}

/// A bit that is set, zeros, and the number of bits as the last eight bytes of a block.
Sha256 Sha256Stream::finish() {
  const std::uint64_t bits = bytes_ * 8;
  std::array<std::uint8_t, 2 * kBlockBytes> end{0x80};
  const auto begun = static_cast<std::size_t>(bytes_ % kBlockBytes);
  const std::size_t padding = (begun < kBlockBytes - 8 ? kBlockBytes : 2 * kBlockBytes) - begun;
  for (std::size_t i = 0; i < 8; ++i) end[padding - 1 - i] = static_cast<std::uint8_t>(bits >> 8 * i);
  add({end.data(), padding});
  Sha256 digest;
  for (std::size_t i = 0; i < digest.size(); ++i)
    digest[i] = static_cast<std::uint8_t>(state_[i / 4] >> (24 - 8 * (i % 4)));
  return digest;
}

}  // namespace texmesh
