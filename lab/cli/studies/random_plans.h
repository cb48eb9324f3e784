#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "delivery/cpp/client/delivery_plan.h"

namespace texmesh {

/// How a plan came about.
/// - kBudget: scale and height are drawn, and the bytes that `plan --budget` spends.
/// - kLink: a link, a round trip and a time limit are drawn; scale and rungs are what a client chooses.
/// - kMix: nobody's choice: scale, mips of each group and the rung of every fragment are drawn.
enum class DrawnKind : std::uint8_t { kBudget, kLink, kMix };
struct DrawnPlan {
  DrawnKind kind = DrawnKind::kBudget;
  DeliveryRequest request;
  DeliveryPlan plan;
};
std::string name_of(DrawnKind kind);

/// `count` plans of the package, the kinds in turn, by rising displayed height (256 to 1024 px). The same for
/// the same seed on every machine.
std::vector<DrawnPlan> draw_plans(PackageReader& package, int count, std::uint64_t seed);

/// A choice of scale and rungs, with what is predicted of it.
DeliveryPlan plan_of(PackageReader& package, const DeliveryRequest& request, int scale,
                     const std::vector<PlaneChoice>& planes, const std::vector<std::int32_t>& rungs);

}  // namespace texmesh
