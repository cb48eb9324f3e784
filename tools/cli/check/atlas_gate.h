#pragma once
#include <optional>
#include <vector>

#include "tools/cli/check/check_gate.h"
#include "tools/inspect/atlas/atlas_report.h"

namespace texmesh {

/// What `doctor` asks for. Shares are 0..1. Charts and triangles count over the model, the rest for every
/// texture.
struct AtlasLimits {
  std::optional<double> max_charts, max_floor_triangles;
  std::optional<double> min_cover, max_thin, max_overlap, max_flat, max_density_spread, max_stretch,
      max_seam_difference;
};

/// One result for each limit and, where it counts for every texture, each texture; a model without textures
/// keeps all limits. Seams that were not compared keep theirs.
std::vector<GateResult> check_atlases(const AtlasDiagnosis& diagnosis, const AtlasLimits& limits);

}  // namespace texmesh
