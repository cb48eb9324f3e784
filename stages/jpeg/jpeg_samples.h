#pragma once
// Inside stages only: what a JPEG is made of before it is transformed.
#include <cstddef>
#include <vector>

#include "stages/jpeg/jpeg_coder.h"

namespace texmesh {

/// A component's samples before chroma is halved, less 128, row by row. In libjpeg's integers.
void jpeg_samples(const PixelWindow& image, const JpegKind& kind, std::size_t component,
                  std::vector<float>& out);

/// Whether components other than the first have half as many samples each way.
inline bool halves_chroma(const JpegKind& kind) {
  return kind.channels == 3 && !kind.rgb && kind.subsampling == Subsampling::k420;
}

/// The pair of Huffman tables that codes a component.
inline std::size_t table_pair(const JpegKind& kind, std::size_t component) {
  return component > (kind.rgb ? 1u : 0u) ? 1 : 0;  // as JpegCoder
}

}  // namespace texmesh
