#pragma once
#include "pipeline/import/import.h"

namespace texmesh::fuzz {

/// The defaults, but for pictures: of these 100 kB may well be 400 million pixels that somebody wants, and
/// the limit, an option, is what bounds their memory and time.
inline ImportOptions reader_limits() {
  ImportOptions options;
  options.max_image_pixels = 1 << 20;
  return options;
}

}  // namespace texmesh::fuzz
