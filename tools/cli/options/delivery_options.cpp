#include "tools/cli/options/delivery_options.h"

#include "pipeline/io/file_resolver.h"
#include "pipeline/io/table.h"

namespace texmesh {
Option add_display_option(Command& c, DeliveryArguments& a) {
  return c.option("--display", a.request.displayed_px, "Displayed height of the object, device pixels", "PX")
      .number_in(1, 1e6)
      .shows_default();
}

void add_time_option(Command& c, DeliveryArguments& a) {
  c.option(
       "--time",
       [&a](const std::string& text) {
         a.request.time_limit_s = parse_duration(text, "--time");
         if (!(a.request.time_limit_s > 0)) throw UsageError("--time", "", "a time above 0", text);
       },
       "Time limit from the first request on: 4, 1.5s, 800ms", "TIME")
      .shows_default(shortest(a.request.time_limit_s));
}

Option add_rtt_option(Command& c, DeliveryArguments& a, const std::string& help) {
  // Round trips are told in milliseconds everywhere else, so a bare number is one.
  const std::function<void(const std::string&)> take = [&a](const std::string& text) {
    const bool bare = text.find_first_not_of("0123456789.") == std::string::npos;
    a.request.network.rtt_s = parse_duration(bare ? text + "ms" : text, "--rtt");
  };
  return c.option("--rtt", take, help, "TIME").shows_default("0");
}

Option add_bandwidth_option(Command& c, DeliveryArguments& a, const std::string& help) {
  const std::function<void(const std::string&)> take = [&a](const std::string& text) {
    a.request.network.link = BandwidthTrace::constant(parse_bandwidth(text, "--bandwidth"));
    a.has_link = true;
  };
  return c.option("--bandwidth", take, help, "RATE");
}

Option add_scale_option(Command& c, DeliveryArguments& a) {
  return c.option("--scale", a.request.scale, "This scale instead of the scale that looks best")
      .integer_in(0, 99);
}

Option add_policy_option(Command& c, DeliveryArguments& a) {
  return c
      .choice(
          "--policy", a.request.htc.policy,
          "How textures are chosen: guard = the thesis's method around the plan of least loss, with sizes "
          "within a factor of 1.5 of that plan's share; thesis = chapters 4 and 7 as printed, with --rule "
          "distance, one request at a time, hard limits of quality, and the list that T_0 beta_0 pays")
      .shows_default("guard");
}

Option add_rule_option(Command& c, DeliveryArguments& a) {
  return c.choice(
      "--rule", a.rule,
      "Which scale is enough: flip = by lit pictures, which compile has compared with those of "
      "the finest scale; jnd = by the just-noticeable difference; error = by an error of one "
      "pixel; edge = by edges of one pixel; distance = a major scale for each distance, as the thesis prints "
      "it (7.5). Default: flip, and distance with --policy thesis");
}

Option add_jnd_option(Command& c, DeliveryArguments& a) {
  return c
      .option("--jnd", a.request.jnd,
              "The viewer's own just-noticeable difference: the coarsest scale that this viewer cannot tell "
              "from the one that --rule names")
      .number_in(0.001, 1);
}

void add_memory_option(Command& c, DeliveryArguments& a) {
  c.option(
      "--memory",
      [&a](const std::string& text) {
        a.request.memory_bytes = static_cast<double>(parse_bytes(text, "--memory"));
      },
      "GPU memory for mesh and textures, 64MB: coarser scales and mips where more would be taken "
      "(default: any)",
      "SIZE");
}

void add_package_and_view_options(Command& c, DeliveryArguments& a, bool package_required) {
  Option package =
      c.option("PACKAGE", a.package, "A .texmesh file, a folder that unpack made, or an http(s) URL");
  if (package_required) package.required();
  add_time_option(c, a);
  Option display = add_display_option(c, a);
  c.option("--distance", a.distance,
           "Viewing distance instead of --display, in heights (largest extents) of the object")
      .number_in(1e-3, 1e6)
      .excludes(display);
  c.option("--fov", a.camera.fov_degrees, "Vertical field of view for --distance, degrees")
      .number_in(0.01, 179)
      .shows_default()
      .rare();
  c.option("--viewport", a.camera.viewport_px, "Height of the picture for --distance, device pixels", "PX")
      .number_in(1, 1e6)
      .shows_default()
      .rare();
  add_scale_option(c, a);
  add_memory_option(c, a);
}

void add_link_options(Command& c, DeliveryArguments& a) {
  c.group("Network");
  Option bandwidth = add_bandwidth_option(c, a, "Throughput of the link: 2Mbit/s, 41.68kB/s");
  c.option(
       "--trace",
       [&a](const std::string& file) {
         const auto bytes = read_input_file(file, 1u << 30);
         a.request.network.link = read_trace_csv(std::string(bytes.begin(), bytes.end()), file);
         a.has_link = true;
       },
       "CSV of the link's throughput: lines of seconds,bytes per second", "FILE")
      .excludes(bandwidth);
  add_rtt_option(c, a, "Round trip: 40 or 40ms are milliseconds, 0.04s seconds");
  c.option("--connections", a.request.network.connections, "Connections per server")
      .integer_in(1, 1000)
      .shows_default()
      .rare();
}

void add_delivery_options(Command& c, DeliveryArguments& a) {
  add_package_and_view_options(c, a, true);
  add_link_options(c, a);
  c.option("--mirror", a.mirrors, "A server's own rate, 2Mbit/s; several times for several servers", "RATE");
  c.group("Method");
  add_policy_option(c, a).rare();
  add_rule_option(c, a).rare();
  add_jnd_option(c, a).rare();
  c.group("");
}

DeliveryRequest delivery_request(const DeliveryArguments& a) {
  DeliveryRequest r = a.request;
  if (a.needs_link && !a.has_link)
    throw UsageError("--bandwidth", "", "the throughput of the link, or --trace FILE", "neither");
  if (a.distance > 0) r.displayed_px = std::clamp(displayed_height_px(1, a.distance, a.camera), 1.0, 1e6);
  if (r.htc.policy == Policy::kThesis) r = as_printed(r);
  if (a.rule) r.rule = *a.rule;
  if (!a.mirrors.empty()) r.network.mirrors.clear();
  for (const std::string& rate : a.mirrors)
    r.network.mirrors.push_back({BandwidthTrace::constant(parse_bandwidth(rate, "--mirror"))});
  return r;
}

}  // namespace texmesh
