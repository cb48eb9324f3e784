#pragma once
// Inside format/base and its tests: the compression function of SHA-256 (FIPS 180-4), twice.
#include <array>
#include <cstddef>
#include <cstdint>

namespace texmesh {

using Sha256State = std::array<std::uint32_t, 8>;

/// Takes in so many blocks of 64 bytes.
void add_sha256_blocks(Sha256State& state, const std::uint8_t* data, std::size_t blocks);

/// The two that it chooses from; both give the same state.
void add_sha256_blocks_plain(Sha256State& state, const std::uint8_t* data, std::size_t blocks);
/// By the processor's own instructions: only where has_sha256_instructions().
void add_sha256_blocks_by_instructions(Sha256State& state, const std::uint8_t* data, std::size_t blocks);
bool has_sha256_instructions();

}  // namespace texmesh
