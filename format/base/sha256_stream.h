#pragma once
#include <nettle/sha2.h>

#include "format/base/sha256.h"

namespace texmesh {

/// The digest of bytes that come piece by piece, however small.
class Sha256Stream {
 public:
  Sha256Stream();
  void add(std::span<const std::uint8_t> piece);
  std::uint64_t bytes() const { return bytes_; }
  /// Of all pieces so far; none may follow.
  Sha256 finish();

 private:
  sha256_ctx state_;
  std::uint64_t bytes_ = 0;
};

}  // namespace texmesh
