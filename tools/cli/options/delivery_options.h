#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "delivery/cpp/client/delivery_plan.h"

namespace texmesh {

class Command;
class Option;

/// What plan, check and simulate ask about how a package is looked at and over what.
struct DeliveryArguments {
  std::string package, time = "5", bandwidth, trace, rtt = "0", policy = "guard", order, estimator = "auto",
                       rule, beta0, memory;  // order and rule: "" = by the policy; memory: "" = any
  std::vector<std::string> mirrors;
  double display_px = 1000, distance = 0, loss = 0;  // distance > 0 counts instead of display_px
  Camera camera;
  int scale = -1, window = 0, connections = 6, samples = 10;
  std::uint64_t seed = 1;
  bool hard_limits = false, slow_start = false, connect_costs = false, json = false;
  bool needs_link = true;  // false: a budget in bytes, or a real network
};
void add_delivery_options(Command& command, DeliveryArguments& args, bool package_required);

// Single options of these, for commands that take some of them only.
Option add_display_option(Command& command, DeliveryArguments& args);
void add_time_option(Command& command, DeliveryArguments& args);
void add_rtt_option(Command& command, DeliveryArguments& args);
Option add_scale_option(Command& command, DeliveryArguments& args);
Option add_policy_option(Command& command, DeliveryArguments& args);
Option add_window_option(Command& command, DeliveryArguments& args);
void add_memory_option(Command& command, DeliveryArguments& args);

/// UsageError names the flag.
DeliveryRequest delivery_request(const DeliveryArguments& args);
/// "at 1.25 s", or "never" for what a network does not bring.
std::string moment(double time_s);
/// What is shown takes on the GPU, one line.
std::string gpu_text(const GpuBytes& bytes);
/// The same as {mesh, textures, all}.
nlohmann::ordered_json gpu_json(const GpuBytes& bytes);

}  // namespace texmesh
