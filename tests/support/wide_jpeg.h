#pragma once
#include <cstdint>
#include <vector>

namespace texmesh::testing {

/// A JPEG of 12 bits (DCT, quality 95) or 16 (lossless): `samples`, interleaved, top row first, 1 or 3
/// channels.
std::vector<std::uint8_t> wide_jpeg(unsigned width, unsigned height, std::vector<std::uint16_t> samples,
                                    unsigned bits);

}  // namespace texmesh::testing
