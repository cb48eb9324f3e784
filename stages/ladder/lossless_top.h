#pragma once
// Inside the ladder only.
#include <optional>
#include <string>
#include <vector>

#include "format/documents/textures.h"
#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"

namespace texmesh {

/// `ladder`, of `plane`, with a top that loses nothing of the plane's source image:
/// - of a JPEG in a plane coded as baseline JPEG a last rung that holds the source's quantised coefficients,
///   cut at the borders of fragments, which are borders of its blocks; a progressive source becomes baseline.
///   Decoded fragments equal the decoded source but for the 1-px ring of 4:2:0. What was filled in where no
///   chart lies is not in it. Blocks beyond the image have no AC coefficients. A rung of quality 100 makes
///   room.
/// - of anything else, and of JPEGs whose coefficients cannot be cut (other colour spaces, sampling factors
///   over 2, quantisers over 255, colours that import converts), the file as it is, by PlaneLadder::source.
/// Mips and alpha planes have no top: an alpha plane relies on its image's colour plane. A note says why a
/// JPEG stays whole. Takes two bytes per sample of the image beside the result. Same bytes for any thread
/// count.
PlaneLadder with_lossless_top(PlaneLadder ladder, const TexturePlane& plane, const Image& image, Notes& notes,
                              const RunContext& context);

/// The coefficients of `image` cut into the plane's fragments; nothing, with the reason in `why_not`, where a
/// baseline JPEG cannot hold them.
std::optional<LadderRung> cut_coefficients(const TexturePlane& plane, const Image& image,
                                           std::string& why_not, const RunContext& context);

}  // namespace texmesh
