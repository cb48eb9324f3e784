#pragma once
// Inside the ladder only: which parts of a plane's pixels codecs are given.
#include <cstddef>
#include <vector>

#include "stages/data/fragments.h"
#include "stages/data/pixels.h"
#include "stages/image/pixel_window.h"
#include "stages/ladder/ladder.h"

namespace texmesh {

/// Heights of windows in samples are multiples of this.
inline constexpr std::uint32_t kSampleRows = 16;

/// One fragment; with its coverage where some of its texels are not covered and these are free. Its place in
/// the plane is CoverageWindow::left_px and top_px in any case.
PixelWindow fragment_window(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered,
                            std::size_t fragment);

/// What Huffman tables are trained on: the middle rows of `wanted` covered fragments, evenly spread in index
/// order, or of all where there are fewer. Together they have 1/16 of the plane's pixels, or 131,072 where
/// that is more, so far as the fragments have so many. `rows`: their heights are multiples of this, which
/// divides the fragments'.
std::vector<PixelWindow> training_sample(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered,
                                         int wanted, std::uint32_t rows = kSampleRows);

/// What measure_size_knots() is shown: tiles of 64 x `rows` px all over the covered fragments, one of every
/// few at places that follow no pattern, up to 2^20 px.
std::vector<PixelWindow> size_sample(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered,
                                     std::uint32_t rows = kSampleRows);

}  // namespace texmesh
