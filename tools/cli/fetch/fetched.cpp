#include "tools/cli/fetch/fetched.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "format/container/layout.h"
#include "pipeline/io/table.h"
#include "tools/cli/fetch/server_share.h"
#include "tools/cli/options/delivery_options.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

/// What the link has shown: shares of servers, test packets, a recording.
void add_link_json(const Fetched& f, const LinkWatch& watch, Json& j) {
  if (f.load.mirrors.size() > 1) {
    Json servers = Json::array();
    for (std::size_t i = 0; i < f.load.mirrors.size(); ++i) {
      servers.push_back({{"url", shown_url(f.urls[i])}});
      servers.back().update(server_json(f.load.mirrors[i]));
    }
    j["servers"] = servers;
  }
  if (watch.probes()) {
    Json samples = Json::array();
    for (const BandwidthSample& s : watch.monitor().samples())
      samples.push_back({{"time_s", s.time_s},
                         {"packet_bytes", s.packet_bytes},
                         {"seconds", s.seconds},
                         {"bytes_s", s.bytes_s}});
    j["probes"] = {
        {"packets", watch.monitor().sent()}, {"bytes", watch.monitor().sent_bytes()}, {"samples", samples}};
  }
}

std::string link_text(const Fetched& f, const LinkWatch& watch) {
  std::string text;
  if (f.load.mirrors.size() > 1)
    for (std::size_t i = 0; i < f.load.mirrors.size(); ++i)
      text += server_text(shown_url(f.urls[i]), f.load.mirrors[i]);
  if (watch.probes()) {
    const BandwidthMonitor& monitor = watch.monitor();
    text += fmt::format("{} test packets with {} bytes beside the textures, {} arrived", monitor.sent(),
                        grouped(monitor.sent_bytes()), monitor.samples().size());
    if (!monitor.samples().empty())
      text += fmt::format("; the last one: {:.0f} kB/s", monitor.samples().back().bytes_s / 1e3);
    text += '\n';
  }
  if (watch.recorded_steps() > 0)
    text += fmt::format("recorded the link in {} steps\n", watch.recorded_steps());
  return text;
}

Json fetch_document(const Fetched& f, double limit_s) {
  Json j{{"version", 1},
         {"scale", f.scale},
         {"rtt_s", f.rtt_s},
         {"url", shown_url(f.place.url)},
         {"whole_rungs", f.whole_rungs},
         {"first_picture_s", f.first_picture_s},
         {"mesh_s", f.mesh_s},
         {"end_s", f.end_s},
         {"deviation_percent", 100 * (limit_s - f.end_s) / limit_s},
         {"mesh_bytes", f.mesh_bytes},
         {"texture_bytes", f.texture_bytes},
         {"requests", f.load.transfer.steps.size()},
         {"fragments", f.load.fragments},
         {"skipped", f.load.skipped},
         {"given_up", f.load.given_up},
         {"problems", f.load.problems},
         {"cancelled", f.load.cancelled},
         {"texture_flip", f.texture_flip},
         {"flip", f.flip},
         {"gpu_bytes", gpu_json(f.gpu)}};
  if (f.proxy) j["proxy"] = *f.proxy;
  if (f.step) j["step"] = {{"proxy", f.step->proxy}, {"at_s", f.step->at_s}};
  if (f.refined)
    j["refined"] = {{"seconds", f.refined->transfer.end_s}, {"bytes", f.refined->transfer.bytes}};
  return j;
}

std::string load_text(const Fetched& f, double limit_s) {
  std::string text;
  if (f.proxy) {
    text += fmt::format(
        "{}: first picture after {:.3f} s, {} after {:.3f} s ({} bytes); round trip {:.1f} ms\n"
        "predicted FLIP {:.4f} (0 = equal to the source): nothing else is needed\n",
        shown_url(f.place.url), f.first_picture_s, proxy_path(*f.proxy), f.mesh_s, grouped(f.mesh_bytes),
        1000 * f.rtt_s, f.flip);
    return text + gpu_text(f.gpu);
  }
  if (f.step) text += fmt::format("on the way: {} after {:.3f} s\n", proxy_path(f.step->proxy), f.step->at_s);
  text += fmt::format(
      "{}: first picture and tables after {:.3f} s, S_{} after {:.3f} s ({} bytes); round trip {:.1f} ms\n"
      "textures after {:.3f} s: {:+.2f} % of the limit of {:.2f} s, {} bytes in {} fragments, {} skipped, {} "
      "given up\n",
      shown_url(f.place.url), f.first_picture_s, f.scale, f.mesh_s, grouped(f.mesh_bytes), 1000 * f.rtt_s,
      f.end_s, 100 * (limit_s - f.end_s) / limit_s, limit_s, grouped(f.load.transfer.bytes), f.load.fragments,
      f.load.skipped, f.load.given_up);
  if (f.place.in_memory)
    text += "the server knows no ranges and has no tree: the whole container was fetched\n";
  else if (f.whole_rungs)
    text += "whole rungs: all fragments of a texture at once\n";
  for (const auto& [why, count] : f.load.problems) text += fmt::format("  {} x {}\n", count, why);
  if (f.refined)
    text += fmt::format("refined for {:.3f} s with {} bytes{}\n", f.refined->transfer.end_s,
                        grouped(f.refined->transfer.bytes),
                        f.refined->out_of_time ? ", until its time was over" : "");
  text += fmt::format("predicted FLIP {:.4f} (0 = equal to the source), {:.4f} by the textures alone{}\n",
                      f.flip, f.texture_flip, f.load.cancelled ? "; cancelled" : "");
  return text + gpu_text(f.gpu);
}

}  // namespace

std::string fetched_json(const Fetched& f, const LinkWatch& watch, double limit_s) {
  Json j = fetch_document(f, limit_s);
  add_link_json(f, watch, j);
  return j.dump() + '\n';
}

std::string fetched_text(const Fetched& f, const LinkWatch& watch, double limit_s) {
  return load_text(f, limit_s) + link_text(f, watch);
}

}  // namespace texmesh
