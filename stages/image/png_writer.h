#pragma once
#include <cstdint>
#include <vector>

#include "stages/data/pixels.h"

namespace texmesh {

struct PngOptions {
  int level = 9;        // of deflate, 1 to 9
  bool linear = false;  // the values are light: chunk gAMA of 1
};

/// A PNG file (ISO/IEC 15948) of 1, 3 or 4 channels with 8 bits each: one filter per row by the least sum of
/// absolute differences, deflate, no ancillary chunks but gAMA, so the same pixels always give the same
/// bytes.
std::vector<std::uint8_t> write_png(const Pixels& pixels, const PngOptions& options = {});

}  // namespace texmesh
