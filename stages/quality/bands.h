#pragma once
// Inside the room only: the rows in which large pictures are rendered and compared.
#include <cstdint>
#include <vector>

#include "stages/measure/picture.h"

namespace texmesh::quality {

/// Where a view shows S_0.
struct ShownRows {
  double first = 0, end = 1;          // parts of the picture's side
  std::vector<std::uint32_t> pixels;  // by row of a smaller picture, that show something
};

/// Bands of rows, evenly spread over those that show the object. What is compared has the values that it has
/// in the whole picture: beside it as much is rendered as filters see.
struct Bands {
  std::vector<std::uint8_t> rendered;  // as look() takes them; empty: all rows
  std::vector<std::uint8_t> compared;  // by row
  /// Takes the rows that are not compared out of the picture's covered pixels.
  void cut(Picture& picture) const;
};

/// For a size at which views show about so many pixels of the object each: one band in as many as leave
/// kEnoughPixels, but at least two bands. Whole pictures where bands would miss most of the object.
Bands choose_bands(const ShownRows& view, std::uint32_t side_px, double pixels);

}  // namespace texmesh::quality
