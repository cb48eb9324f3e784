#pragma once
#include <array>
#include <cstdint>
#include <span>

#include "format/base/sha256.h"

namespace texmesh {

/// The digest of bytes that come piece by piece, however small.
class Sha256Stream {
 public:
  void add(std::span<const std::uint8_t> piece);
  std::uint64_t bytes() const { return bytes_; }
  /// Of all pieces so far; none may follow.
  Sha256 finish();

 private:
  static constexpr std::size_t kBlockBytes = 64;
  std::array<std::uint32_t, 8> state_{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                      0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<std::uint8_t, kBlockBytes> begun_{};  // the block that bytes_ ends in
  std::uint64_t bytes_ = 0;
};

}  // namespace texmesh
