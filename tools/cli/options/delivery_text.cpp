#include "tools/cli/options/delivery_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/table.h"
#include "tools/inspect/simulation_plot.h"

namespace texmesh {

std::string moment(double time_s) {
  constexpr double kNever_s = 1e8;  // no link that a request may ask for takes as long
  return time_s < kNever_s ? fmt::format("at {:.2f} s", time_s) : "never";
}

std::string gpu_text(const GpuBytes& bytes) {
  return fmt::format("on the GPU: at most {:.1f} MB of textures, {:.1f} MB of mesh\n",
                     static_cast<double>(bytes.textures) / 1e6, static_cast<double>(bytes.mesh) / 1e6);
}

nlohmann::ordered_json gpu_json(const GpuBytes& bytes) {
  return {{"mesh", bytes.mesh}, {"textures", bytes.textures}, {"all", bytes.all()}};
}

nlohmann::ordered_json server_json(const MirrorShare& share) {
  nlohmann::ordered_json j{{"requests", share.requests}, {"bytes", share.bytes}, {"bytes_s", share.bytes_s}};
  if (!share.dropped.empty()) j["dropped"] = share.dropped;
  return j;
}

std::string server_text(const std::string& name, const MirrorShare& share) {
  return fmt::format("  {}: {} requests, {} bytes, {:.0f} kB/s{}\n", name, share.requests,
                     grouped(share.bytes), share.bytes_s / 1e3,
                     share.dropped.empty() ? "" : "; dropped: " + share.dropped);
}

nlohmann::ordered_json simulated_json(const DeliveryPlan& p, double limit_s) {
  const SimulationResult& r = p.textures;
  nlohmann::ordered_json j{{"version", 1},
                           {"scale", p.scale},
                           {"first_picture_s", p.first_picture_s},
                           {"mesh_s", p.mesh_s},
                           {"complete_s", p.complete_s},
                           {"whole_limit_s", limit_s},
                           {"whole_deviation_percent", 100 * (limit_s - p.complete_s) / limit_s},
                           {"whole_late_s", std::max(0.0, p.complete_s - limit_s)},
                           {"time_limit_s", r.time_limit_s},
                           {"end_s", r.end_s},
                           {"deviation_percent", r.deviation_percent},
                           {"late_s", r.late_s},
                           {"bytes", r.bytes},
                           {"fragments", r.rungs.size()},
                           {"skipped", r.skipped},
                           {"mean_quality", p.mean_quality},
                           {"worst_quality", p.worst_quality},
                           {"texture_flip", p.texture_flip},
                           {"flip", p.flip},
                           {"warnings", p.warnings}};
  if (r.mirrors.size() > 1)
    for (const MirrorShare& m : r.mirrors) j["servers"].push_back(server_json(m));
  return j;
}

std::string simulated_text(const DeliveryPlan& p, double limit_s) {
  const SimulationResult& r = p.textures;
  std::string text =
      fmt::format("S_{} complete {}, textures {}: deviation {:+.2f} % of {:.2f} s, late {:.3f} s\n", p.scale,
                  moment(p.mesh_s), moment(p.complete_s), 100 * (limit_s - p.complete_s) / limit_s, limit_s,
                  std::max(0.0, p.complete_s - limit_s));
  if (r.time_limit_s > 0)
    text += fmt::format("textures alone (T_0 = {:.3f} s): {:.3f} s, deviation {:+.2f} %, late {:.3f} s\n",
                        r.time_limit_s, r.end_s, r.deviation_percent, r.late_s);
  text += fmt::format(
      "{} bytes in {} fragments, {} skipped; quality {:.0f} in the mean, {:.0f} at worst; predicted FLIP "
      "{:.4f} (0 = equal to the source)\n",
      grouped(r.bytes), r.rungs.size(), r.skipped, p.mean_quality, p.worst_quality, p.flip);
  for (std::size_t i = 0; r.mirrors.size() > 1 && i < r.mirrors.size(); ++i)
    text += server_text(fmt::format("server {}", i + 1), r.mirrors[i]);
  for (const std::string& w : p.warnings) text += "warning: " + w + "\n";
  return text;
}

std::vector<double> simulated_qualities(PackageReader& package, const DeliveryPlan& plan,
                                        const FragmentList& list) {
  std::vector<double> qualities;
  for (const HtcStep& s : plan.textures.steps) {
    const PlaneTables& t = package.tables().planes[list.fragments[s.offer].plane];
    qualities.push_back(s.rung < 0 ? 0 : t.rung_quality[static_cast<std::size_t>(s.rung)]);
  }
  return qualities;
}

void write_simulation_plot(const std::string& file, const std::string& title, const DeliveryPlan& plan,
                           const std::vector<double>& qualities, const BandwidthTrace& link) {
  constexpr int kSamples = 400;
  BandwidthTrace shown{{}, {}};
  const double span_s = std::max(1.1 * plan.textures.time_limit_s, 1e-3);
  for (int i = 0; i <= kSamples; ++i) {
    shown.time_s.push_back(span_s * i / kSamples);
    shown.bytes_s.push_back(link.at(plan.mesh_s + shown.time_s.back()));
  }
  const std::string svg = simulation_svg(
      plan.textures, qualities, shown,
      fmt::format("{}: S_{}, textures within {:.2f} s", title, plan.scale, plan.textures.time_limit_s));
  write_output_file(file, text_bytes(svg));
}

}  // namespace texmesh
