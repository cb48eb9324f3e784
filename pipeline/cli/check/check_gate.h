#pragma once
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "delivery/cpp/client/delivery_plan.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// What `check` asks for.
struct Gate {
  double max_flip = 1, max_texture_flip = 1, max_first_picture_s = std::numeric_limits<double>::infinity();
  std::uint64_t max_bytes = ~0ull;
};

/// One limit and whether it is kept.
struct GateResult {
  std::string name;     // what was looked at
  std::string failure;  // one sentence; "" = good enough
};

/// The limits of a plan, and its time limit.
std::vector<GateResult> check_plan(const DeliveryPlan& plan, const Gate& gate, double time_limit_s);
/// FLIP, measured by rendering, of each scale at its switch size (pipeline/report/switch_sizes.h). Reads the
/// whole package.
std::vector<GateResult> check_switch_sizes(PackageReader& package, double max_flip, int views,
                                           const RunContext& context);

/// JUnit XML: one test suite, a case per result.
std::string gate_junit(const std::string& package, const std::vector<GateResult>& results);

}  // namespace texmesh
