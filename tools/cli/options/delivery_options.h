#pragma once

#include "delivery/cpp/client/delivery_plan.h"
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

}  // namespace texmesh
