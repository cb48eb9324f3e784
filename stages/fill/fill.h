#pragma once

#include "format/model/model.h"
#include "stages/data/fragments.h"
#include "stages/data/pixels.h"
#include "stages/data/stage.h"

namespace texmesh {

/// Raise, too, when stages/image decodes images to other pixels than before.
inline constexpr int kFillVersion = 1;

/// What blocks of 16 x 16 texels become that are covered in part: kSparse makes their uncovered texels such
/// that any codec finds few coefficients; kSmooth leaves the smooth fill, for an encoder that
/// knows which texels are free, as the ladder's baseline JPEG does, and costs a sixth of the time.
enum class PartBlocks : std::uint8_t { kSparse, kSmooth };

/// The pixels of every plane: decoded, uncovered texels filled, and extended to columns x fragment_width by
/// rows x fragment_height: edges repeated to the end of their 16 x 16 block, flat blocks beyond (never seen,
/// nearly free). A mip is the next finer plane, filled smoothly, halved (stages/image/resize.h), its
/// blocks made cheap in turn. Derived data, never stored: zim, ladder and lut share one copy. Throws
/// InputError for an image that does not decode, StageError for planes that do not fit the images or each
/// other.
std::vector<Pixels> fill_planes(const Fragments& fragments, const std::vector<Image>& images, Fill fill,
                                const RunContext& context, PartBlocks part = PartBlocks::kSparse);

/// Push-pull: gives every texel whose coverage bit (as TexturePlane::coverage) is 0 a smooth continuation of
/// the covered ones, and makes that cheap for JPEG; covered ones keep their value. Without any
/// covered texel nothing changes.
void fill_uncovered(Pixels& pixels, const std::vector<std::uint8_t>& coverage, const RunContext& context,
                    PartBlocks part = PartBlocks::kSparse);

}  // namespace texmesh
