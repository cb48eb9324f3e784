#pragma once
#include <cstdint>
#include <vector>

#include "stages/data/pixels.h"

namespace texmesh {

/// A PNG file (ISO/IEC 15948) of 1, 3 or 4 channels with 8 bits each: one filter per row by the least sum of
/// absolute differences, deflate level 9, no ancillary chunks, so the same pixels always give the same bytes.
std::vector<std::uint8_t> write_png(const Pixels& pixels);

}  // namespace texmesh
