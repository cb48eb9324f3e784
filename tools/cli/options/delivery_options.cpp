#include "tools/cli/options/delivery_options.h"

#include <fmt/format.h>
#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tools/cli/options/command_line.h"
#include "tools/cli/options/units.h"

namespace texmesh {
namespace {

template <class T>
T choice(const std::string& name, const std::vector<std::pair<std::string, T>>& names) {
  for (const auto& [n, value] : names)
    if (n == name) return value;
  throw UsageError(name, "", "a name that the option's help lists", name);
}

std::string read_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf())) throw InputError(path, "", "a readable file", "none");
  return text.str();
}

/// "2Mbit/s", "2Mbit/s,dead=3.5s", "2Mbit/s,lies=0s".
MirrorModel mirror_of(const std::string& text) {
  MirrorModel m;
  const std::size_t comma = text.find(',');
  m.rate = BandwidthTrace::constant(parse_bandwidth(text.substr(0, comma), "--mirror"));
  if (comma == std::string::npos) return m;
  const std::string rest = text.substr(comma + 1);
  const bool dies = rest.starts_with("dead="), lies = rest.starts_with("lies=");
  if (!dies && !lies) throw UsageError("--mirror", "", "RATE, RATE,dead=SECONDS or RATE,lies=SECONDS", text);
  (dies ? m.dead_from_s : m.lies_from_s) = parse_duration(rest.substr(5), "--mirror");
  return m;
}

}  // namespace

Option add_display_option(Command& c, DeliveryArguments& a) {
  return c.option("--display", a.display_px, "Displayed height of the object, device pixels")
      .number_in(1, 1e6)
      .value_name("PX")
      .shows_default();
}

void add_time_option(Command& c, DeliveryArguments& a) {
  c.option("--time", a.time, "Time limit from the first request on: 4, 1.5s, 800ms")
      .value_name("TIME")
      .shows_default();
}

void add_rtt_option(Command& c, DeliveryArguments& a) {
  c.option("--rtt", a.rtt, "Round trip: 40 or 40ms are milliseconds, 0.04s seconds")
      .value_name("TIME")
      .shows_default();
}

Option add_scale_option(Command& c, DeliveryArguments& a) {
  return c.option("--scale", a.scale, "This scale instead of the scale that looks best").integer_in(0, 99);
}

Option add_policy_option(Command& c, DeliveryArguments& a) {
  return c
      .option(
          "--policy", a.policy,
          "htca = the thesis's method; guard = htca around the plan of least loss, with sizes within a "
          "factor of 1.5 of that plan's share; price = one price of bytes, which rises when the transfer "
          "is late; proportional = planned sizes scaled by the time left; static = planned sizes, always; "
          "thesis = chapters 4 and 7 as printed: htca with --rule jnd, --order beta0, --window 1 and "
          "--hard-limits, textures at full size, the list that T_0 beta_0 pays")
      .one_of_explained({"htca", "guard", "price", "proportional", "static", "thesis"})
      .value_name("NAME")
      .shows_default();
}

Option add_window_option(Command& c, DeliveryArguments& a) {
  return c.option("--window", a.window, "Requests in flight; 0 = by throughput and round trip")
      .integer_in(0, 64)
      .shows_default();
}

void add_memory_option(Command& c, DeliveryArguments& a) {
  c.option(
       "--memory", a.memory,
       "GPU memory for mesh and textures, 64MB: coarser scales and mips where more would be taken (default: "
       "any)")
      .value_name("SIZE");
}

namespace {

void add_camera_options(Command& c, DeliveryArguments& a) {
  Option display = add_display_option(c, a);
  c.option("--distance", a.distance,
           "Viewing distance instead of --display, in heights (largest extents) of the object")
      .number_in(1e-3, 1e6)
      .excludes(display);
  c.option("--fov", a.camera.fov_degrees, "Vertical field of view for --distance, degrees")
      .number_in(0.01, 179)
      .shows_default()
      .rare();
  c.option("--viewport", a.camera.viewport_px, "Height of the picture for --distance, device pixels")
      .number_in(1, 1e6)
      .value_name("PX")
      .shows_default()
      .rare();
}

void add_link_options(Command& c, DeliveryArguments& a) {
  c.group("Network");
  Option bandwidth =
      c.option("--bandwidth", a.bandwidth, "Throughput of the link: 2Mbit/s, 41.68kB/s").value_name("RATE");
  c.option("--trace", a.trace, "CSV of the link's throughput: lines of seconds,bytes per second")
      .value_name("FILE")
      .excludes(bandwidth);
  add_rtt_option(c, a);
  c.option("--mirror", a.mirrors,
           "A server's own rate, 2Mbit/s; with ,dead=3s it dies then, with ,lies=3s its bytes are wrong from "
           "then on; several times for several servers")
      .value_name("RATE");
  c.option("--connections", a.connections, "Connections per server")
      .integer_in(1, 1000)
      .shows_default()
      .rare();
  c.flag("--connect-costs", a.connect_costs, "A connection's first request takes another round trip").rare();
  c.flag("--slow-start", a.slow_start, "Connections begin slowly, as TCP's do").rare();
  c.option("--loss", a.loss, "Share of packets lost").number_in(0, 0.5).shows_default().rare();
  c.option("--seed", a.seed, "Seed of lost packets").shows_default().rare();
}

void add_method_options(Command& c, DeliveryArguments& a) {
  c.group("Method");
  add_policy_option(c, a).rare();
  c.option("--order", a.order,
           "Next fragment: credit = by the sign of the credit; beta0 = by the throughput, as first "
           "published; finest = always the finest. Default: finest with --policy guard, beta0 with thesis, "
           "else credit")
      .one_of_explained({"credit", "beta0", "finest"})
      .value_name("NAME")
      .rare();
  c.option("--estimator", a.estimator,
           "Throughput: last = of the last transfer; harmonic = harmonic mean of several; ewma = mean that "
           "forgets older transfers; auto = by the policy")
      .one_of_explained({"auto", "last", "harmonic", "ewma"})
      .value_name("NAME")
      .shows_default()
      .rare();
  c.option("--samples", a.samples, "Transfers that the harmonic mean takes")
      .integer_in(1, 64)
      .shows_default()
      .rare();
  c.option("--beta0", a.beta0, "First guess of the throughput (default: what the mesh's transfer has shown)")
      .value_name("RATE")
      .rare();
  add_window_option(c, a).rare();
  c.flag("--hard-limits", a.hard_limits,
         "Qualities stay within 5 .. 97 and no fragment is skipped, however late the transfer is (default: "
         "only while there is time enough)")
      .rare();
  c.option(
       "--rule", a.rule,
       "Which scale is enough: flip = by lit pictures, which compile has compared with those of the finest "
       "scale; jnd = by the just-noticeable difference; error = by an error of one pixel; edge = by edges of "
       "one pixel. Default: flip, and jnd with --policy thesis")
      .one_of_explained({"flip", "jnd", "error", "edge"})
      .value_name("NAME")
      .rare();
}

}  // namespace

void add_delivery_options(Command& c, DeliveryArguments& a, bool package_required) {
  Option package =
      c.option("PACKAGE", a.package, "A .texmesh file, a folder that unpack made, or an http(s) URL");
  if (package_required) package.required();
  add_time_option(c, a);
  add_camera_options(c, a);
  add_scale_option(c, a);
  add_memory_option(c, a);
  add_link_options(c, a);
  add_method_options(c, a);
  c.group("");
}

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

DeliveryRequest delivery_request(const DeliveryArguments& a) {
  DeliveryRequest r;
  r.displayed_px =
      a.distance > 0 ? std::clamp(displayed_height_px(1, a.distance, a.camera), 1.0, 1e6) : a.display_px;
  r.scale = a.scale;
  if (a.policy == "thesis") r = as_printed(r);
  if (!a.rule.empty())
    r.rule = choice<StepRule>(a.rule, {{"flip", StepRule::kFlip},
                                       {"jnd", StepRule::kJnd},
                                       {"error", StepRule::kError},
                                       {"edge", StepRule::kEdge}});
  if (!a.memory.empty()) r.memory_bytes = static_cast<double>(parse_bytes(a.memory, "--memory"));
  r.time_limit_s = parse_duration(a.time, "--time");
  if (!(r.time_limit_s > 0)) throw UsageError("--time", "", "a time above 0", a.time);
  if (a.needs_link && a.bandwidth.empty() && a.trace.empty())
    throw UsageError("--bandwidth", "", "the throughput of the link, or --trace FILE", "neither");
  if (!a.bandwidth.empty())
    r.network.link = BandwidthTrace::constant(parse_bandwidth(a.bandwidth, "--bandwidth"));
  if (!a.trace.empty()) r.network.link = read_trace_csv(read_file(a.trace), a.trace);
  // Round trips are told in milliseconds everywhere else, so a bare number is one.
  const bool bare = a.rtt.find_first_not_of("0123456789.") == std::string::npos;
  r.network.rtt_s = parse_duration(bare ? a.rtt + "ms" : a.rtt, "--rtt");
  r.network.connections = a.connections;
  r.network.connect_costs = a.connect_costs;
  r.network.slow_start = a.slow_start;
  r.network.loss = a.loss;
  r.network.seed = a.seed;
  if (!a.mirrors.empty()) r.network.mirrors.clear();
  for (const std::string& m : a.mirrors) r.network.mirrors.push_back(mirror_of(m));
  r.htc.policy = choice<Policy>(a.policy, {{"htca", Policy::kHtc},
                                           {"guard", Policy::kGuard},
                                           {"price", Policy::kPrice},
                                           {"proportional", Policy::kProportional},
                                           {"static", Policy::kStatic},
                                           {"thesis", Policy::kThesis}});
  r.htc.order = a.order.empty() ? default_order(r.htc.policy)
                                : choice<HtcOrder>(a.order, {{"credit", HtcOrder::kCredit},
                                                             {"beta0", HtcOrder::kBeta0},
                                                             {"finest", HtcOrder::kFinest}});
  const bool harmonic = r.htc.policy == Policy::kPrice || r.htc.policy == Policy::kProportional ||
                        r.htc.policy == Policy::kStatic;
  r.htc.throughput.estimator = a.estimator == "auto"
                                   ? (harmonic ? Estimator::kHarmonic : Estimator::kLast)
                                   : choice<Estimator>(a.estimator, {{"last", Estimator::kLast},
                                                                     {"harmonic", Estimator::kHarmonic},
                                                                     {"ewma", Estimator::kEwma}});
  r.htc.throughput.samples = a.samples;
  if (a.window > 0) r.htc.window = a.window;
  if (a.hard_limits) r.htc.hard_limits = true;
  if (!a.beta0.empty()) r.beta0_bytes_s = parse_bandwidth(a.beta0, "--beta0");
  return r;
}

}  // namespace texmesh
