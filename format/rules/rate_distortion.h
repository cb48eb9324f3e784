#pragma once

#include "format/documents/tables.h"

namespace texmesh {

/// Mean of 1 - SSIM over the object's surface for such a choice, by surface_weights(); 0 without a surface.
double surface_dssim(const PlaneTables& tables, const std::vector<std::int16_t>& rungs);

/// What a fragment's quality is worth: its surface fraction, with the area per texel capped at the 99th
/// percentile of all covered texels (a few stretched texels must not take the whole budget). [F]
std::vector<float> surface_weights(const PlaneTables& tables);

/// One fragment as the rate-distortion choice sees it: what each way of showing it costs and loses. Way 0 is
/// skipping (0 bytes); others may stand in any order.
struct RdCurve {
  std::vector<std::uint32_t> bytes;
  std::vector<std::uint64_t> loss;  // same length; at most 2^46, so that differences are exact as doubles
};
/// Per curve the way to show it, so that the sum of losses is least that the convex hulls of the curves allow
/// within the budget: steps along the hulls are taken by falling (loss saved / byte), ties by curve; a step
/// that does not fit ends its curve, others go on. One rounded division per step decides, so that every
/// implementation chooses alike. O(steps log steps).
std::vector<std::uint32_t> spend_bytes(const std::vector<RdCurve>& curves, std::uint64_t budget_bytes);
/// The curves of a plane's stored fragments, in index order. `weights` [F] >= 0 are scaled so that the
/// largest becomes 2^20 units; `share` scales them all (0..1: the plane's own importance beside others).
std::vector<RdCurve> rd_curves(const PlaneTables& tables, const std::vector<float>& weights,
                               double share = 1);
/// The rung of every fragment that loses least surface-weighted (1 - SSIM) for at most `budget_bytes` of
/// fragment streams, skipping included. `weights` default to surface_weights().
std::vector<std::int16_t> allocate_rd(const PlaneTables& tables, std::uint64_t budget_bytes,
                                      const std::vector<float>& weights = {});

}  // namespace texmesh
