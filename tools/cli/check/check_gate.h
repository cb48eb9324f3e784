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
/// FLIP, measured by rendering, of each scale at its switch size (tools/publish/report/switch_sizes.h). Reads
/// the whole package.
std::vector<GateResult> check_switch_sizes(PackageReader& package, double max_flip, int views,
                                           const RunContext& context);

/// JUnit XML: one test suite of this name ("texmesh check"), a case per result. `input`: what was checked.
std::string gate_junit(const std::string& suite, const std::string& input,
                       const std::vector<GateResult>& results);
/// Writes it to a file. Errors as write_output_file().
void write_gate_junit(const std::string& path, const std::string& suite, const std::string& input,
                      const std::vector<GateResult>& results);
/// The sentences of the limits that are not kept.
std::vector<std::string> gate_failures(const std::vector<GateResult>& results);

}  // namespace texmesh
