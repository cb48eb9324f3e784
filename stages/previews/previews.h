#pragma once

#include "stages/data/fragments.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kPreviewsVersion = 1;

/// Users set these as ladder.preview_quality and ladder.subsampling, beside the rungs that follow a preview.
struct PreviewOptions {
  int quality = 60;                             // IJG's scale, 1..100
  Subsampling subsampling = Subsampling::k420;  // of sRGB planes; data planes are never subsampled
};

/// A preview of every full-size plane: a baseline JPEG of 1/8 of each side, rounded up, or of 1/16 where that
/// of 1/8 would reach 16 KB. Its texels are means of what mips are means of (stages/image/resize.h).
/// `pixels` are fill_planes()'s. Throws StageError for pixels that do not fit the planes. Same bytes for any
/// thread count.
Previews make_previews(const Fragments& fragments, const std::vector<Pixels>& pixels,
                       const PreviewOptions& options, const RunContext& context);

}  // namespace texmesh
