#include "tools/inspect/simulation_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace texmesh {
namespace {

constexpr double kWidth = 960, kPanel = 190, kLeft = 70, kTop = 50, kGap = 50, kPlot = kWidth - kLeft - 30;

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '<')
      out += "&lt;";
    else if (c == '&')
      out += "&amp;";
    else if (c == '>')
      out += "&gt;";
    else
      out += c;
  }
  return out;
}

/// The step of 1, 2 or 5 times a power of ten that divides a span into about so many parts.
double round_step(double span, int parts) {
  const double least = span / parts, power = std::pow(10.0, std::floor(std::log10(least)));
  for (const double digit : {1.0, 2.0, 5.0})
    if (digit * power >= least) return digit * power;
  return 10 * power;
}

/// One of the panels beneath each other, with axes from 0 (or below) to a largest value.
class Panel {
 public:
  Panel(int number, const std::string& title, double end_s, double low, double high)
      : top_(kTop + number * (kPanel + kGap)), end_s_(end_s), low_(low), high_(high > low ? high : low + 1) {
    const double step = round_step(high_ - low_, 5), step_s = round_step(end_s_, 10);
    low_ = step * std::floor(low_ / step);
    high_ = step * std::ceil(high_ / step);
    svg_ =
        fmt::format("<text x=\"{}\" y=\"{:.1f}\" class=\"t\">{}</text>\n", kLeft, top_ - 10, escaped(title));
    for (double v = low_; v <= high_ + step / 2; v += step)
      svg_ += fmt::format(
          "<path class=\"g\" d=\"M{} {:.1f}H{}\"/><text x=\"{}\" y=\"{:.1f}\" class=\"l e\">{:.4g}</text>\n",
          kLeft, y(v), kLeft + kPlot, kLeft - 8, y(v) + 4, std::abs(v) < step / 2 ? 0 : v);
    for (double t = 0; t <= end_s_; t += step_s)
      svg_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"l m\">{:.3g} s</text>\n", x(t),
                          top_ + kPanel + 16, t);
  }
  double x(double t) const { return kLeft + kPlot * std::clamp(t / end_s_, 0.0, 1.0); }
  double y(double v) const {
    return top_ + kPanel * (1 - (std::clamp(v, low_, high_) - low_) / (high_ - low_));
  }
  void add(const std::string& svg) { svg_ += svg; }
  /// A line that steps from value to value.
  void steps(const std::vector<std::pair<double, double>>& points, const char* style) {
    if (points.empty()) return;
    std::string d = fmt::format("M{:.1f} {:.1f}", x(points[0].first), y(points[0].second));
    for (std::size_t i = 1; i < points.size(); ++i)
      d += fmt::format("H{:.1f}V{:.1f}", x(points[i].first), y(points[i].second));
    svg_ += fmt::format("<path class=\"{}\" d=\"{}H{:.1f}\"/>\n", style, d, x(end_s_));
  }
  void limit(double t) {
    svg_ += fmt::format("<path class=\"d\" d=\"M{:.1f} {:.1f}V{:.1f}\"/>\n", x(t), top_, top_ + kPanel);
  }
  const std::string& svg() const { return svg_; }

 private:
  double top_, end_s_, low_, high_;
  std::string svg_;
};

}  // namespace

std::string simulation_svg(const SimulationResult& result, const std::vector<double>& qualities,
                           const BandwidthTrace& link, const std::string& title) {
  double last_s = std::max(std::isfinite(result.end_s) ? result.end_s : 0.0, 1e-3);
  if (std::isfinite(result.time_limit_s)) last_s = std::max(last_s, result.time_limit_s);
  const double end_s = 1.02 * last_s;
  Panel quality(0, "quality of fragments, from request to arrival (grey ticks: skipped)", end_s, 0, 100);
  double top_rate = 0, low_credit = 0, high_credit = 0;
  std::vector<std::pair<double, double>> rate, belief, credit;
  for (std::size_t i = 0; i < link.time_s.size() && link.time_s[i] < end_s; ++i) {
    rate.emplace_back(link.time_s[i], link.bytes_s[i] / 1e3);
    top_rate = std::max(top_rate, link.bytes_s[i] / 1e3);
  }
  for (std::size_t i = 0; i < result.steps.size(); ++i) {
    const HtcStep& s = result.steps[i];
    if (s.rung < 0)
      quality.add(
          fmt::format("<path class=\"s\" d=\"M{:.1f} {:.1f}v-8\"/>\n", quality.x(s.issued_s), quality.y(0)));
    else
      quality.add(fmt::format("<path class=\"f\" d=\"M{:.1f} {:.1f}H{:.1f}\"/>\n", quality.x(s.issued_s),
                              quality.y(qualities[i]),
                              std::max(quality.x(s.done_s), quality.x(s.issued_s) + 1)));
    belief.emplace_back(s.issued_s, s.throughput_bytes_s / 1e3);
    credit.emplace_back(s.issued_s, 1e3 * s.credit_s);
    low_credit = std::min(low_credit, 1e3 * s.credit_s);
    high_credit = std::max(high_credit, 1e3 * s.credit_s);
  }
  // What bunched completions make the plan believe for a moment would flatten the rest.
  Panel rates(1, "throughput, kB/s: the link (blue), what the plan went by (orange)", end_s, 0,
              1.6 * top_rate);
  rates.steps(rate, "b");
  rates.steps(belief, "o");
  Panel credits(2, "credit of the fragment asked for, ms", end_s, low_credit, high_credit);
  credits.steps(credit, "c");
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} "
      "{1:.0f}\">\n"
      "<style>text{{font:12px "
      "sans-serif;fill:#333}}.t{{font-size:13px}}.h{{font-size:16px}}.e{{text-anchor:end}}.m{{text-anchor:"
      "middle}}path{{fill:none}}.g{{stroke:#e4e4e4}}.f{{stroke:#2b6cb0;stroke-width:2;opacity:.6}}.s{{stroke:"
      "#999}}"
      ".b{{stroke:#2b6cb0;stroke-width:1.5}}.o{{stroke:#dd7711;opacity:.8}}.c{{stroke:#2f855a;stroke-width:1."
      "5}}"
      ".d{{stroke:#c53030;stroke-dasharray:5 4}}</style>\n<rect width=\"100%\" height=\"100%\" "
      "fill=\"#fff\"/>\n"
      "<text x=\"{2}\" y=\"22\" class=\"h\">{3}</text>\n",
      kWidth, kTop + 3 * (kPanel + kGap), kLeft, escaped(title));
  for (Panel* p : {&quality, &rates, &credits}) {
    p->limit(result.time_limit_s);
    svg += p->svg();
  }
  return svg + "</svg>\n";
}

}  // namespace texmesh
