#pragma once
#include <cstdint>
#include <vector>

#include "tools/extract/glb/extracted.h"

namespace texmesh {

/// Scales of a file with levels of detail whose finest is `finest`: that one, and all coarser major ones.
std::vector<int> levels_of(const Manifest& manifest, int finest);
/// Share of the screen's area that a square around the object has at the displayed height up to which `scale`
/// is enough, on a screen 1080 px high; what MSFT_lod asks for a level.
double screen_coverage_of(const Manifest& manifest, int scale);

/// For each number of bytes the file of at most so many with the least FLIP against the package's best:
/// scale, coding of the mesh, size and quality of every texture are chosen together, by lit pictures
/// (stages/render, the studio's light), so that each map gets bytes for what it changes in them. Small
/// windows of the pictures, one texture changed at a time, tell what bytes are worth; the mesh is chosen by
/// what it and its textures lose together; the whole pictures of the file give the difference that is
/// reported. Where a proxy of the package, made smaller where it must be, looks better in whole pictures, the
/// file is of that proxy (ProxyOffers). request.bytes does not count. What does not depend on the number of
/// bytes is made once; every file is the one that its number alone gives. InputError for a scale that is not
/// there. Same bytes for any number of threads.
std::vector<Extracted> extract_bytes(PackageReader& package, const ExtractRequest& request,
                                     const std::vector<std::uint64_t>& bytes, const RunContext& context);

}  // namespace texmesh
