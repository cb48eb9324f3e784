#pragma once
#include <cstdint>
#include <span>

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

/// A plane as a client shows it: each fragment at its rung, row by row; -1, and what is not stored = as the
/// preview of the full-size plane `base` shows it, scaled up bilinearly. Errors as read_plane();
/// std::invalid_argument where the number of rungs is another. Same result for any thread count.
Pixels read_shown_plane(PackageReader& package, std::uint32_t base, std::uint32_t plane,
                        std::span<const std::int32_t> rungs, const RunContext& context);

/// InputError where no plane of the package has that rung. kBestRung is always there.
void require_rung(PackageReader& package, std::uint32_t rung);

}  // namespace texmesh
