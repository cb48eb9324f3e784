#pragma once
#include <cstdint>
#include <optional>

#include "stages/base/run_context.h"
#include "stages/proxies/atlas_mesh.h"
#include "stages/proxies/charts/segment_charts.h"

namespace texmesh {

/// Packs charts into a texture of width_px x height_px (1..16384 each) with texels of one size as far as
/// whole texels allow. nullopt when there are more charts than a texture of this size can hold: a larger
/// texture, or fewer triangles, will do. Same bytes everywhere. Throws Cancelled.
std::optional<AtlasMesh> pack_atlas(const ProxySurface& surface, const SurfaceCharts& charts,
                                    std::uint32_t width_px, std::uint32_t height_px, std::uint32_t gutter_px,
                                    const RunContext& context);

}  // namespace texmesh
