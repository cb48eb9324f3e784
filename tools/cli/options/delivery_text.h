#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "delivery/cpp/client/delivery_plan.h"

namespace texmesh {

// What plan, check, simulate and fetch say of a delivery.

/// "at 1.25 s", or "never" for what a network does not bring.
std::string moment(double time_s);
/// What is shown takes on the GPU, one line.
std::string gpu_text(const GpuBytes& bytes);
/// The same as {mesh, textures, all}.
nlohmann::ordered_json gpu_json(const GpuBytes& bytes);
/// What one of several servers has brought: of fetch.v1 and simulate.v1 the fields that both have; a line.
nlohmann::ordered_json server_json(const MirrorShare& share);
std::string server_text(const std::string& name, const MirrorShare& share);

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
