#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "delivery/cpp/client/delivery_plan.h"

namespace texmesh {

/// What so many bytes look like: predicted FLIP against S_0 with the source's texels.
struct QualityPoint {
  int scale = 0;
  std::optional<std::uint32_t> proxy = {};  // instead of the scale
  std::uint64_t bytes = 0;                  // all that a client reads, from the first request on
  double flip = 0;
};

/// What bytes buy at one displayed height.
struct QualityCurves {
  double displayed_px = 0;
  /// Per scale of the manifest: previews alone, then every rung, all planes alike.
  std::vector<std::vector<QualityPoint>> scales;
  std::vector<QualityPoint> proxies;  // each alone, by rising bytes
  std::vector<QualityPoint> budgets;  // plan_budget() at bytes that rise by equal factors
};

/// At every height of the package's quality table. `budgets` >= 2.
std::vector<QualityCurves> quality_curves(PackageReader& package, int budgets);

}  // namespace texmesh
