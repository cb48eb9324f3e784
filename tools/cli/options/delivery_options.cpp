#include "tools/cli/options/delivery_options.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"
#include "tools/publish/pages/page.h"

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

namespace {

using Points = std::vector<std::pair<double, double>>;

/// One of the plots beneath each other: steps of values over time.
Plot panel(const std::string& name, double end_s, double limit_s, const char* colour, const Points& steps) {
  Plot plot;
  plot.title = plot.y_name = name;
  plot.x_name = "s";
  plot.linear_x = true;
  plot.x_low = 0, plot.x_high = end_s;
  plot.y_high = 0;
  for (const auto& [time_s, value] : steps) {
    plot.y_low = std::min(plot.y_low, value);
    plot.y_high = std::max(plot.y_high, value);
  }
  plot.series.push_back({"", colour, steps});
  plot.series.back().steps = true;
  plot.series.push_back({"", "e", {{limit_s, -1e9}, {limit_s, 1e9}}, false, true});
  return plot;
}

Plot quality_panel(const SimulationResult& result, const std::vector<double>& qualities, double end_s) {
  Plot plot = panel("quality of fragments, from request to arrival; dots: skipped", end_s,
                    result.time_limit_s, "a", {});
  plot.y_high = 100;
  PlotSeries skipped{"", "q", {}};
  skipped.dots = true;
  for (std::size_t i = 0; i < result.steps.size(); ++i) {
    const HtcStep& s = result.steps[i];
    if (s.rung < 0)
      skipped.points.emplace_back(s.issued_s, 0);
    else
      plot.series.push_back({"", "a", {{s.issued_s, qualities[i]}, {s.done_s, qualities[i]}}});
  }
  plot.series.push_back(std::move(skipped));
  return plot;
}

std::string simulation_svg(const SimulationResult& result, const std::vector<double>& qualities,
                           const BandwidthTrace& link, const std::string& title) {
  constexpr int kWidth = 800, kPanel = 390, kTop = 40;
  double last_s = std::max(std::isfinite(result.end_s) ? result.end_s : 0.0, 1e-3);
  if (std::isfinite(result.time_limit_s)) last_s = std::max(last_s, result.time_limit_s);
  const double end_s = 1.02 * last_s, limit_s = result.time_limit_s;
  Points rate, belief, credit;
  for (std::size_t i = 0; i < link.time_s.size() && link.time_s[i] < end_s; ++i)
    rate.emplace_back(link.time_s[i], link.bytes_s[i] / 1e3);
  for (const HtcStep& s : result.steps) {
    belief.emplace_back(s.issued_s, s.throughput_bytes_s / 1e3);
    credit.emplace_back(s.issued_s, 1e3 * s.credit_s);
  }
  Plot rates = panel("throughput, kB/s", end_s, limit_s, "a", rate);
  rates.y_high *= 1.6;  // what bunched completions make the plan believe for a moment would flatten the rest
  rates.series.front().name = "the link";
  rates.series.push_back({"what the plan went by", "b", belief});
  rates.series.back().steps = true;
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\">\n"
      "<style>{2}</style>\n<rect width=\"100%\" height=\"100%\" fill=\"var(--page)\"/>\n"
      "<text x=\"20\" y=\"26\">{3}</text>\n",
      kWidth, kTop + 3 * kPanel, page_style(""), markup_escaped(title));
  int top = kTop;
  for (const Plot& plot : {quality_panel(result, qualities, end_s), rates,
                           panel("credit of the fragment asked for, ms", end_s, limit_s, "c", credit)}) {
    svg += fmt::format("<g transform=\"translate(20 {})\">\n{}</g>\n", top, plot.svg());
    top += kPanel;
  }
  return svg + "</svg>\n";
}

}  // namespace

std::string moment(double time_s) {
  constexpr double kNever_s = 1e8;  // no link that a request may ask for takes as long
  return time_s < kNever_s ? fmt::format("at {:.2f} s", time_s) : "never";
}

std::string gpu_text(const GpuBytes& bytes) {
  return fmt::format("on the GPU: at most {:.1f} MB of textures, {:.1f} MB of mesh\n",
                     static_cast<double>(bytes.textures) / 1e6, static_cast<double>(bytes.mesh) / 1e6);
}

std::string server_text(const std::string& name, const MirrorShare& share) {
  return fmt::format("  {}: {} requests, {} bytes, {:.0f} kB/s{}\n", name, share.requests,
                     grouped(share.bytes), share.bytes_s / 1e3,
                     share.dropped.empty() ? "" : "; dropped: " + share.dropped);
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
  for (const std::string& w : p.warnings) text += "note: " + w + "\n";
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
