#include "format/base/sha256/sha256_stream.h"

namespace texmesh {

Sha256Stream::Sha256Stream() { sha256_init(&state_); }

void Sha256Stream::add(std::span<const std::uint8_t> piece) {
  bytes_ += piece.size();
  sha256_update(&state_, piece.size(), piece.data());
}

Sha256 Sha256Stream::finish() {
  Sha256 digest;
  sha256_digest(&state_, digest.size(), digest.data());
  return digest;
}

}  // namespace texmesh
