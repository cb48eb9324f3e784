#pragma once
#include <span>

#include "stages/base/run_context.h"
#include "stages/image/pixel_window.h"

namespace texmesh {

/// How three channels become the components of JPEGs.
struct CodingSpace {
  bool apart = true;                            // as they are; otherwise as YCbCr
  Subsampling subsampling = Subsampling::k444;  // of YCbCr
  bool coarse_last = false;                     // of channels apart: JpegKind::coarse_last
  bool without_z = false;                       // x and y apart, z is rebuilt: Codec::kJpegXy
  friend bool operator==(const CodingSpace&, const CodingSpace&) = default;
};

/// What three channels of data are: the vectors of a normal map, whose error is the angle, or numbers.
enum class DataKind : std::uint8_t { kVectors, kNumbers };

/// The space in which baseline JPEGs of the data have the least mean error for their bytes: channels apart,
/// vectors with a coarse z or not or with z left to the reader (unless `needs_z`), YCbCr 4:4:4 or YCbCr
/// 4:2:0. Error is the angle of vectors and the squared error of numbers, over covered texels. Measured on at
/// most 32 windows of `sample` at three qualities; bytes are compared at equal errors. A space is left out
/// whose least error is more than twice that of channels apart. Channels apart for an empty sample. `sample`:
/// windows of 3 channels, whose sides are multiples of 16. Same result for any thread count.
CodingSpace measure_coding_space(DataKind kind, bool needs_z, std::span<const PixelWindow> sample,
                                 const RunContext& context);

}  // namespace texmesh
