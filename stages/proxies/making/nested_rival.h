#pragma once
// Inside the room only: what a nested scale with the source's atlas looks like for the bytes of a proxy.
#include "stages/data/nested_scales.h"
#include "stages/proxies/measure/proxy_studio.h"

namespace texmesh::proxies {

/// Whether a nested scale with textures that so many bytes buy has at most this mean FLIP at the studio's
/// middle height. Bytes are estimated, and textures are those of the mip that fits, without losses of coding:
/// the rival is a little better than the real one.
bool rival_wins(const NestedScales& scales, const ShownMaterials& shown, std::uint64_t bytes, double flip,
                ProxyStudio& studio, const RunContext& context);

/// Bytes of S_0's whole mesh, coded; within 20 % for scans.
double whole_mesh_bytes(const NestedScales& scales);

/// Whether S_0's whole mesh, coded, leaves so much of the bytes to the source's textures that no atlas of
/// a proxy's own can win. An atlas in pieces costs more than its texels, so it leaves its proxies a chance
/// for longer.
bool whole_mesh_is_small(const NestedScales& scales, std::uint64_t bytes);

}  // namespace texmesh::proxies
