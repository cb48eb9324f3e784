#pragma once
#include <cstdint>

#include "delivery/cpp/package/package_reader.h"
#include "stages/base/run_context.h"
#include "stages/data/pixels.h"

namespace texmesh {

/// A rung beyond the last one stands for the last one.
inline constexpr std::uint32_t kBestRung = 0xffffffffu;

/// A plane put together again from all its fragments at one rung: width x height texels without the
/// fragments' overhang. What is not stored (nobody sees it) continues its neighbours smoothly, so that
/// smaller copies show no seams. Reads the rung as one entry, digest checked. FormatError when the package is
/// damaged or the plane has more than 4e8 texels. Same result for any thread count.
Pixels read_plane(PackageReader& package, std::uint32_t plane, std::uint32_t rung, const RunContext& context);

/// InputError where no plane of the package has that rung. kBestRung is always there.
void require_rung(PackageReader& package, std::uint32_t rung);

}  // namespace texmesh
