#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "format/base/portable_math.h"
#include "lab/experiment/fit_experiment.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"
#include "tools/publish/pages/page.h"
#include "tools/publish/pages/plot.h"

namespace texmesh {
namespace {

constexpr int kCurvePoints = 80;

/// Shares of right answers at one displayed size, with both curves; levels in percent.
std::string condition_plot(const ConditionFit& fit, double displayed_px) {
  const double low = fit.counts.front().level, high = std::max(fit.counts.back().level, 1.01 * low);
  Plot plot;
  plot.title = fmt::format("share of right answers against the change, {:g} px", displayed_px);
  plot.x_name = "change [%]";
  plot.y_name = "right answers [%]";
  plot.x_low = 100 * low / 1.2, plot.x_high = 100 * high * 1.2, plot.y_high = 100;
  PlotSeries answers{"", "a", {}, false, false, true},
      sigmoid{"answers and sigmoid", "a", {}, false, false, false}, line{"line", "b", {}, false, true, false},
      quarter{"75 %", "q", {}, false, true, false};
  for (const LevelCount& c : fit.counts)
    answers.points.emplace_back(100 * c.level, 100.0 * c.right / c.answers);
  for (int k = 0; k <= kCurvePoints; ++k) {
    const double level =
        low / 1.2 * portable::exp(portable::log(1.44 * high / low) * k / static_cast<double>(kCurvePoints));
    sigmoid.points.emplace_back(100 * level, 100 * fit.sigmoid.curve.share_right(level));
    line.points.emplace_back(100 * level,
                             100 * std::clamp(fit.line.intercept + fit.line.slope * level, 0.0, 1.0));
  }
  quarter.points = {{plot.x_low, 75}, {plot.x_high, 75}};
  plot.series = {quarter, line, sigmoid, answers};
  return plot.svg();
}

std::string distance_plot(const ExperimentFit& fit) {
  Plot plot;
  plot.title = "threshold against the displayed size";
  plot.x_name = "displayed size [px]";
  plot.y_name = "just noticeable change [%]";
  plot.x_low = fit.sizes_px.front() / 1.2, plot.x_high = fit.sizes_px.back() * 1.2;
  const auto law = [&](double exponent, double px) {
    return 100 * fit.study.law.jnd.value *
           portable::exp(exponent * portable::log(fit.study.law.reference_px / px));
  };
  PlotSeries found{"thresholds", "a", {}, false, false, true},
      printed{"as printed", "c", {}, false, true, false}, inverse{"512 / D", "b", {}, false, true, false};
  plot.y_high = 0;
  for (std::size_t c = 0; c < fit.sizes_px.size(); ++c) {
    const Estimate& t = fit.study.conditions[c].threshold;
    found.points.emplace_back(fit.sizes_px[c], 100 * t.value);
    plot.series.push_back({"", "a", {{fit.sizes_px[c], 100 * t.low}, {fit.sizes_px[c], 100 * t.high}}, true});
    plot.y_high = std::max({plot.y_high, 100 * t.high, law(1, fit.sizes_px[c])});
  }
  for (int k = 0; k <= kCurvePoints; ++k) {
    const double px = plot.x_low * portable::exp(portable::log(plot.x_high / plot.x_low) * k / kCurvePoints);
    printed.points.emplace_back(px, law(0, px));
    inverse.points.emplace_back(px, law(1, px));
  }
  plot.series.insert(plot.series.end(), {found, printed, inverse});
  return plot.svg();
}

std::string judges_table(const ExperimentFit& fit) {
  Table table("One row a file of results", {"judge",
                                            "answers",
                                            {"right [%]", percent_form(0)},
                                            {"left [%]", percent_form(0)},
                                            "late",
                                            "catch trials right",
                                            "verdict"});
  for (const FittedJudge& j : fit.judges) {
    const double n = std::max(j.counts.answers, 1u);
    table.row({j.judge, j.counts.answers, j.right / n, j.counts.left / n, j.late,
               fmt::format("{} of {}", j.counts.caught, j.counts.catches), verdict_text(j)});
  }
  return table.html();
}

}  // namespace

std::string fit_page(const ExperimentFit& fit) {
  std::string body = fmt::format(
      "<header><div><h1>What {} judges could just tell</h1><p class=\"verdict{}\">{}</p><p>{}</p>"
      "<p class=\"quiet\">Experiment {}, {}; {} answers without catch trials. Bounds hold 95 % of {} draws of {} "
      "with replacement.</p></div></header>\n<main>\n",
      fit.kept(), fit.found ? "" : " bad", markup_escaped(fit.verdict), markup_escaped(fit.distance_verdict),
      fit.design, fit.kind, fit.answers, fit.options.draws, fit.study.by_judges ? "judges" : "answers");
  std::string curves;
  for (std::size_t c = 0; c < fit.sizes_px.size(); ++c) {
    const ConditionFit& f = fit.study.conditions[c];
    curves += fmt::format(
        "<h3>{:g} px displayed</h3>\n<p>Threshold {:.4f}, 95 % from {:.4f} to {:.4f}; slope {:.1f}, lapses {:.1f} %, "
        "deviance {:.1f} with {} levels.</p>\n<figure>{}</figure>\n",
        fit.sizes_px[c], f.threshold.value, f.threshold.low, f.threshold.high, f.sigmoid.curve.slope,
        100 * f.sigmoid.curve.lapse, f.sigmoid.deviance, f.counts.size(), condition_plot(f, fit.sizes_px[c]));
  }
  body += html_section("curves", "Curves", curves);
  if (fit.sizes_px.size() > 1)
    body += html_section("distance", "Distance", "<figure>" + distance_plot(fit) + "</figure>\n");
  body += html_section("judges", "Judges", judges_table(fit)) + "</main>\n";
  return html_page("What judges could just tell", body);
}

}  // namespace texmesh
