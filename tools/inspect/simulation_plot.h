#pragma once
#include <string>

#include "delivery/cpp/simulate/simulation.h"

namespace texmesh {

/// An SVG of a simulated transfer, over time: each fragment's quality as a bar from request to arrival, the
/// link's throughput and what the plan believed of it, the credit. `qualities` by step, 0 = skipped.
std::string simulation_svg(const SimulationResult& result, const std::vector<double>& qualities,
                           const BandwidthTrace& link, const std::string& title);

}  // namespace texmesh
