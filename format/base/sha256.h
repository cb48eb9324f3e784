#pragma once
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

}  // namespace texmesh
