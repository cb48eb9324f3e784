#pragma once
#include "pipeline/extract/glb/extracted.h"

namespace texmesh {

/// Scales of a file with levels of detail whose finest is `finest`: that one, and all coarser major ones.
std::vector<int> levels_of(const Manifest& manifest, int finest);
/// Share of the screen's area that a square around the object has at the displayed height up to which `scale`
/// is enough, on a screen 1080 px high; what MSFT_lod asks for a level.
double screen_coverage_of(const Manifest& manifest, int scale);

/// The file of at most request.bytes with the least FLIP against the package's best: scale, coding of the
/// mesh, size of textures and their quality are chosen together. Candidates are rendered and compared,
/// not guessed: the quality table of a package knows pictures of 192 px and full-size textures only.
/// Textures of data (normals, roughness) get a fixed share of the bytes for textures, because the
/// renderer does not show them.
Extracted extract_bytes(PackageReader& package, const ExtractRequest& request, const RunContext& context);

}  // namespace texmesh
