#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "tools/publish/report/package_pictures.h"

namespace texmesh {

/// How far pictures may differ before a scale can be told from S_0. Values of texmesh's own.
struct FlipLimits {
  double mean = 0.05;  // FLIP of a view, over the pixels that either picture covers
  double p95 = 0.15;   // 95th percentile of these pixels
};

/// A step of the package's step function, rendered at the height up to which it serves.
struct SwitchSize {
  int scale = 0;
  std::uint32_t triangles = 0;
  double up_to_px = 0;     // as the manifest has it
  double rendered_px = 0;  // less than up_to_px where pictures would be too large
  ViewDifferences views;
  bool holds(const FlipLimits& limits) const {
    return views.worst_mean() <= limits.mean && views.worst_p95() <= limits.p95;
  }
};

/// Every step but S_0's, coarse to fine, in `views` directions spread evenly over the sphere.
std::vector<SwitchSize> measure_switch_sizes(PackageReader& package, PackagePictures& pictures, int views,
                                             const RunContext& context);

/// One sentence that says whether all hold, and which do not.
std::string switch_verdict(const std::vector<SwitchSize>& sizes, const FlipLimits& limits, int views);

/// The largest FLIP, mean of a view, of all of them; 0 for none.
double worst_flip(const std::vector<SwitchSize>& sizes);

}  // namespace texmesh
