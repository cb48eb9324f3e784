#include "format/base/sha256.h"

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

// Not OpenSSL: to load and to start that library takes a fifth of a run over a thousand models that are up
// to date. Nettle uses the same instructions of the processor.
Sha256 sha256(std::span<const std::uint8_t> bytes) {
  Sha256Stream stream;
  stream.add(bytes);
  return stream.finish();
}

std::string to_hex(const Sha256& digest) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string s;
  s.reserve(64);
  for (std::uint8_t b : digest) {
    s += kDigits[b >> 4];
    s += kDigits[b & 15];
  }
  return s;
}

bool from_hex(std::string_view hex, Sha256& digest) {
  if (hex.size() != 64) return false;
  auto value = [](char c) {
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
  };
  for (std::size_t i = 0; i < 32; ++i) {
    const int hi = value(hex[2 * i]), lo = value(hex[2 * i + 1]);
    if (hi < 0 || lo < 0) return false;
    digest[i] = static_cast<std::uint8_t>(hi * 16 + lo);
  }
  return true;
}

std::uint64_t truncated(const Sha256& digest) {
  std::uint64_t v = 0;
  for (int i = 0; i < 8; ++i) v = v << 8 | digest[static_cast<std::size_t>(i)];
  return v;
}

}  // namespace texmesh
