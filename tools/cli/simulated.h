#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tools/cli/options/delivery_options.h"

namespace texmesh {

// What `simulate` says of a simulated delivery; texmesh-lab simulate says it, too.

/// schemas/simulate.v1.schema.json. The whole counts from the first request on, the rest is of the textures
/// alone (the thesis's T_0).
nlohmann::ordered_json simulated_json(const DeliveryPlan& plan, double limit_s);
/// For people; ends with a line end.
std::string simulated_text(const DeliveryPlan& plan, double limit_s);
/// Of each step of the plan, 0 = skipped.
std::vector<double> simulated_qualities(PackageReader& package, const DeliveryPlan& plan,
                                        const FragmentList& list);
/// Writes the SVG of --plot: quality and time by fragment, throughput, credit.
void write_simulation_plot(const std::string& file, const std::string& title, const DeliveryPlan& plan,
                           const std::vector<double>& qualities, const BandwidthTrace& link);

}  // namespace texmesh
