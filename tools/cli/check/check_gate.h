#pragma once

#include "delivery/cpp/client/delivery_plan.h"
#include "tools/inspect/atlas/atlas_report.h"

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
/// FLIP, measured by rendering, of each scale at its switch size (tools/publish/report/report_pictures.h).
/// Reads the whole package.
std::vector<GateResult> check_switch_sizes(PackageReader& package, double max_flip, int views,
                                           const RunContext& context);

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

/// JUnit XML: one test suite of this name ("texmesh check"), a case per result. `input`: what was checked.
std::string gate_junit(const std::string& suite, const std::string& input,
                       const std::vector<GateResult>& results);
/// Writes it to a file; "" = to none. Errors as write_output_file().
void write_gate_junit(const std::string& path, const std::string& suite, const std::string& input,
                      const std::vector<GateResult>& results);
/// The sentences of the limits that are not kept.
std::vector<std::string> gate_failures(const std::vector<GateResult>& results);
/// The same as lines for people; "good enough" where all of some limits are kept.
std::string gate_text(const std::vector<GateResult>& results);

}  // namespace texmesh
