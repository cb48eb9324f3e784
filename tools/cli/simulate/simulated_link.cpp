#include "tools/cli/simulate/simulated_link.h"

#include <fmt/format.h>
#include <cmath>

#include "pipeline/io/table.h"
#include "tools/cli/fetch/server_share.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

/// How the test packets did: their mean relative error against the link, and bytes.
double mean_probe_error(const SimulationResult& r, const BandwidthTrace& link, double start_s) {
  double sum = 0;
  for (const BandwidthSample& s : r.samples) {
    const double to = start_s + s.time_s, truth = link.mean(to - s.seconds, to);
    if (truth > 0) sum += std::abs(s.bytes_s / truth - 1);
  }
  return r.samples.empty() ? 0 : sum / static_cast<double>(r.samples.size());
}

}  // namespace

void add_simulated_link(const DeliveryPlan& p, const BandwidthTrace& link, Json& j) {
  const SimulationResult& r = p.textures;
  if (r.mirrors.size() > 1) {
    Json servers = Json::array();
    for (const MirrorShare& m : r.mirrors) servers.push_back(server_json(m));
    j["servers"] = servers;
  }
  if (r.probes > 0)
    j["probes"] = {{"packets", r.probes},
                   {"bytes", r.probe_bytes},
                   {"arrived", r.samples.size()},
                   {"mean_error", mean_probe_error(r, link, p.mesh_s)}};
}

std::string simulated_link_text(const DeliveryPlan& p, const BandwidthTrace& link) {
  const SimulationResult& r = p.textures;
  std::string text;
  if (r.mirrors.size() > 1)
    for (std::size_t i = 0; i < r.mirrors.size(); ++i)
      text += server_text(fmt::format("server {}", i + 1), r.mirrors[i]);
  if (r.probes > 0)
    text += fmt::format("{} test packets with {} bytes beside the textures; mean error {:.1f} %\n", r.probes,
                        grouped(r.probe_bytes), 100 * mean_probe_error(r, link, p.mesh_s));
  return text;
}

}  // namespace texmesh
