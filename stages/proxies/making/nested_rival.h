#pragma once
// Inside the room only: what a nested scale with the source's atlas looks like for the bytes of a proxy.
#include <map>
#include <vector>

#include "stages/data/nested_scales.h"
#include "stages/proxies/measure/proxy_studio.h"

namespace texmesh::proxies {

/// Nested scales with textures that a proxy's bytes buy. Bytes are estimated, and textures are those of the
/// mip that fits, without losses of coding: a rival is a little better than the real one. Losses are mean
/// FLIP at the studio's middle height.
class NestedRivals {
 public:
  /// All must outlive it.
  NestedRivals(const NestedScales& scales, const ShownMaterials& shown, ProxyStudio& studio);

  /// Whether one of them loses at most as much as a proxy of so many bytes.
  bool win(std::uint64_t bytes, double flip, const RunContext& context);
  /// Whether the likeliest one does; the others are not looked at.
  bool likeliest_wins(std::uint64_t bytes, double flip, const RunContext& context);

 private:
  struct Rival {
    std::size_t scale = 0, dropped_levels = 0;  // of the textures
    auto operator<=>(const Rival&) const = default;
  };
  std::vector<Rival> rivals(std::uint64_t bytes) const;
  double flip_of(const Rival& rival, double flip, const RunContext& context);

  const NestedScales& scales_;
  const ShownMaterials& shown_;
  ProxyStudio& studio_;
  std::vector<double> mesh_bytes_;  // per scale
  std::map<Rival, double> known_;   // FLIP of all views
};

/// Bytes of S_0's whole mesh, coded; within 20 % for scans.
double whole_mesh_bytes(const NestedScales& scales);

/// Whether S_0's whole mesh, coded, leaves so much of the bytes to the source's textures that no atlas of
/// a proxy's own can win. An atlas in pieces costs more than its texels, so it leaves its proxies a chance
/// for longer.
bool whole_mesh_is_small(const NestedScales& scales, std::uint64_t bytes);

}  // namespace texmesh::proxies
