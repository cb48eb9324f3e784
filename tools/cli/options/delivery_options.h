#pragma once

#include "delivery/cpp/client/delivery_plan.h"
#include "pipeline/io/record.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {

template <>
struct EnumNames<Policy> {
  static constexpr std::array<std::string_view, 2> names{"guard", "thesis"};
};
template <>
struct EnumNames<StepRule> {
  static constexpr std::array<std::string_view, 5> names{"flip", "jnd", "error", "edge", "distance"};
};

/// What plan, check, simulate and fetch ask about how a package is looked at and over what. Options write
/// into `request`; delivery_request() adds what several of them say together.
struct DeliveryArguments {
  std::string package;
  DeliveryRequest request;
  std::optional<StepRule> rule;              // not given: the policy's
  double distance = 0;                       // > 0 counts instead of request.displayed_px
  Camera camera;                             // for the distance
  std::vector<std::string> mirrors;          // rates of servers; none: one as fast as any link
  bool has_link = false, needs_link = true;  // needs_link false: a budget in bytes, or a real network
  bool json = false;
};
/// The package, time limit, display and memory; the link; policy and rule.
void add_delivery_options(Command& command, DeliveryArguments& args);

// Parts of these, for commands that take some of them only.
void add_package_and_view_options(Command& command, DeliveryArguments& args, bool package_required);
void add_link_options(Command& command, DeliveryArguments& args);
Option add_display_option(Command& command, DeliveryArguments& args);
void add_time_option(Command& command, DeliveryArguments& args);
Option add_rtt_option(Command& command, DeliveryArguments& args, const std::string& help);
Option add_bandwidth_option(Command& command, DeliveryArguments& args, const std::string& help);
Option add_scale_option(Command& command, DeliveryArguments& args);
Option add_policy_option(Command& command, DeliveryArguments& args);
Option add_rule_option(Command& command, DeliveryArguments& args);
Option add_jnd_option(Command& command, DeliveryArguments& args);
void add_memory_option(Command& command, DeliveryArguments& args);

/// UsageError names the flag.
DeliveryRequest delivery_request(const DeliveryArguments& args);

// What plan, check, simulate and fetch say of a delivery.

template <>
struct RecordFields<GpuBytes> {
  static void fields(auto& s, auto&& v) {
    v("mesh", s.mesh, "Vertex and index buffers, which the browser keeps in main memory, too.");
    v("textures", s.textures, "RGBA with all mip levels.");
    v("all", s.all(), "");
  }
};
/// What one of several servers has brought of the fragments.
template <>
struct RecordFields<MirrorShare> {
  static void fields(auto& s, auto&& v) {
    v("requests", s.requests, "");
    v("bytes", s.bytes, "");
    v("bytes_s", s.bytes_s, Range{0, 1e300},
      "As it is expected to go on; the first guess where it has brought nothing.");
    v("dropped", s.dropped, kMayMiss, "Why it is asked no more.");
  }
};

inline constexpr Range kScaleNumbers{0, 99}, kProxyNumbers{0, 7}, kQualities{0, 100}, kFlips{0, 1};
inline constexpr const char* kFlipMeans =
    "Predicted FLIP of the lit picture against the source's: 0 = equal.";

/// A number, or null for one that is infinite.
inline OrNull<double> finite(double value) {
  return {std::isfinite(value) ? std::optional(value) : std::nullopt};
}
inline constexpr Range kDeviations{-1e300, 100};

/// A proxy that is shown on the way to a scale, and when it is there.
struct ShownStep {
  std::uint32_t proxy = 0;
  double at_s = 0;
  static void fields(auto& s, auto&& v) {
    v("proxy", s.proxy, Range{1, 7}, "");
    v("at_s", finite(s.at_s), kSeconds, "");
  }
};

/// What simulate --json prints. The whole counts from the first request on, the rest is of the textures alone
/// (the thesis's T_0).
struct SimulatedDelivery {
  DeliveryPlan plan;
  double limit_s = 0;
  std::vector<MirrorShare> servers() const {
    return plan.textures.mirrors.size() > 1 ? plan.textures.mirrors : std::vector<MirrorShare>{};
  }
  static void fields(auto& s, auto&& v) {
    const DeliveryPlan& p = s.plan;
    const SimulationResult& r = p.textures;
    v("version", Constant{1}, "");
    v("scale", p.scale, kScaleNumbers, "");
    v("first_picture_s", finite(p.first_picture_s), kSeconds,
      "From the first request on, as mesh_s, complete_s and whole_limit_s; null = never.");
    v("mesh_s", finite(p.mesh_s), kSeconds, "");
    v("complete_s", finite(p.complete_s), kSeconds, "");
    v("whole_limit_s", s.limit_s, kSeconds, "");
    v("whole_deviation_percent", finite(100 * (s.limit_s - p.complete_s) / s.limit_s), kDeviations,
      "(limit - time) / limit; negative when late.");
    v("whole_late_s", finite(std::max(0.0, p.complete_s - s.limit_s)), kSeconds, "");
    v("time_limit_s", r.time_limit_s,
      "T_0 of the textures alone, as end_s, deviation_percent and late_s; 0 or less: the mesh left none.");
    v("end_s", finite(r.end_s), kSeconds, "");
    v("deviation_percent", finite(r.deviation_percent), kDeviations, "");
    v("late_s", finite(r.late_s), kSeconds, "");
    v("bytes", r.bytes, "Of fragments.");
    v("fragments", r.rungs.size(), "");
    v("skipped", r.skipped, "");
    v("mean_quality", p.mean_quality, kQualities, "");
    v("worst_quality", p.worst_quality, kQualities, "");
    v("texture_flip", p.texture_flip, kFlips, "");
    v("flip", p.flip, kFlips, kFlipMeans);
    v("warnings", p.warnings, "");
    v("servers", s.servers(), FieldRule{.count = Range{2, 1000}, .may_miss = true},
      "With several --mirror: what each has brought of the fragments.");
  }
};

// Schemas of what plan and check, simulate, and fetch print.
DocumentSchema plan_schema();
DocumentSchema simulate_schema();
DocumentSchema fetch_schema();

/// "at 1.25 s", or "never" for what a network does not bring.
std::string moment(double time_s);
/// What is shown takes on the GPU, one line.
std::string gpu_text(const GpuBytes& bytes);
/// A line.
std::string server_text(const std::string& name, const MirrorShare& share);
/// For people; ends with a line end.
std::string simulated_text(const DeliveryPlan& plan, double limit_s);
/// Of each step of the plan, 0 = skipped.
std::vector<double> simulated_qualities(PackageReader& package, const DeliveryPlan& plan,
                                        const FragmentList& list);
/// Writes the SVG of --plot over time: each fragment's quality as a bar from request to arrival, the link's
/// throughput and what the plan believed of it, the credit. `qualities` by step, 0 = skipped.
void write_simulation_plot(const std::string& file, const std::string& title, const DeliveryPlan& plan,
                           const std::vector<double>& qualities, const BandwidthTrace& link);

}  // namespace texmesh
