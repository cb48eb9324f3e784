#pragma once
// Inside stages only: the second half of fill_uncovered().
#include <cstdint>
#include <vector>

#include "stages/base/run_context.h"
#include "stages/data/pixels.h"
#include "stages/fill/fill.h"

namespace texmesh {

/// The side in pixels of what a JPEG codes together with 4:2:0.
inline constexpr std::uint32_t kMcu = 16;

/// Makes texels that nobody sees cheap for a JPEG whose blocks start at the image's corner. `pixels` (1 or 3
/// channels) have been filled smoothly; texels whose coverage bit is 1 stay as they are. Only 16 x 16 blocks
/// that lie wholly inside the image are touched:
/// - without a covered texel: flat, of the smooth fill's mean, and of the block's to the left where that one
///   is flat and hardly differs, so that neither AC nor DC coefficients cost more than their least code;
/// - covered in part, when these are to be sparse: uncovered texels of each 8 x 8 block of luma, and of
///   halved chroma, are chosen so that the block has few DCT coefficients: alternating projections with a
///   falling threshold (the sparse extrapolation of Guleryuz 2006; Papoulis and Gerchberg's iteration).
/// Plain single precision in a fixed order (stages/jpeg/block_transform.h): same bytes for any thread count.
void flatten_unseen(Pixels& pixels, const std::vector<std::uint8_t>& coverage, PartBlocks part,
                    const RunContext& context);

}  // namespace texmesh
