#include "format/base/sha256.h"

#include <openssl/evp.h>

#include <memory>
#include <stdexcept>

namespace texmesh {
namespace {

/// Fetched once: EVP_sha256() is looked up again at each use.
const EVP_MD* algorithm() {
  static const EVP_MD* const md = EVP_MD_fetch(nullptr, "SHA256", nullptr);
  return md;
}

/// Kept for the thread: to make one takes longer than to digest a name.
EVP_MD_CTX* context() {
  static thread_local const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> kept(EVP_MD_CTX_new(),
                                                                                         &EVP_MD_CTX_free);
  return kept.get();
}

}  // namespace

Sha256 sha256(std::span<const std::uint8_t> bytes) {
  Sha256 digest{};
  unsigned size = 0;
  if (!algorithm() || !context() || EVP_DigestInit_ex2(context(), algorithm(), nullptr) != 1 ||
      EVP_DigestUpdate(context(), bytes.data(), bytes.size()) != 1 ||
      EVP_DigestFinal_ex(context(), digest.data(), &size) != 1 || size != digest.size())
    throw std::runtime_error("SHA-256 is not available from OpenSSL");
  return digest;
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
