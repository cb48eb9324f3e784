#pragma once
#include <nettle/sha2.h>
#include <array>
#include <cstdint>
#include <span>
#include <string>

namespace texmesh {

using Sha256 = std::array<std::uint8_t, 32>;

Sha256 sha256(std::span<const std::uint8_t> bytes);
std::string to_hex(const Sha256& digest);             // 64 lower-case digits
bool from_hex(std::string_view hex, Sha256& digest);  // false unless exactly 64 lower-case digits
/// The first 8 bytes as a big-endian number: what tables hold per fragment.
std::uint64_t truncated(const Sha256& digest);

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
