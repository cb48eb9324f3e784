#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "delivery/cpp/client/delivery_plan.h"

namespace texmesh {

/// What the servers and the test packets of a simulated delivery did. `link`: of the whole delivery.
void add_simulated_link(const DeliveryPlan& p, const BandwidthTrace& link, nlohmann::ordered_json& j);
std::string simulated_link_text(const DeliveryPlan& p, const BandwidthTrace& link);

}  // namespace texmesh
