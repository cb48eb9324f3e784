#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "format/base/json_fields.h"
#include "lab/experiment/fit_experiment.h"
#include "pipeline/io/table.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kDocument = "fit";

const char* word_of(const FittedJudge& j) {
  if (j.repeated) return "repeated";
  constexpr const char* kWords[]{"kept", "too-few", "one-side", "inattentive"};
  return kWords[static_cast<std::size_t>(j.verdict)];
}

/// null for what is not a number.
Json number(double value) { return std::isfinite(value) ? Json(six_digits(value)) : Json(nullptr); }

Json estimate_json(const Estimate& e) {
  return {{"value", number(e.value)}, {"low", number(e.low)}, {"high", number(e.high)}};
}

Json condition_json(const ConditionFit& c, double displayed_px) {
  Json levels = Json::array();
  for (const LevelCount& l : c.counts)
    levels.push_back({{"level", l.level}, {"answers", l.answers}, {"right", l.right}});
  return {{"displayed_px", displayed_px},
          {"threshold", estimate_json(c.threshold)},
          {"slope", number(c.sigmoid.curve.slope)},
          {"lapse", number(c.sigmoid.curve.lapse)},
          {"deviance", number(c.sigmoid.deviance)},
          {"within", c.sigmoid.within},
          {"line_threshold", estimate_json(c.line_threshold)},
          {"levels", std::move(levels)}};
}

Json judge_json(const FittedJudge& j) {
  return {{"file", j.file},           {"judge", j.judge},
          {"verdict", word_of(j)},    {"answers", j.counts.answers},
          {"right", j.right},         {"left", j.counts.left},
          {"late", j.late},           {"catches", j.counts.catches},
          {"caught", j.counts.caught}};
}

std::string method_text(const ExperimentFit& fit) {
  return fmt::format(
      "{} judges ({} left out), {} answers to {}, 2AFC with reference, 75 % of a {}, 95 % bounds {:.4f} to "
      "{:.4f}; experiment {}",
      fit.kept(), fit.judges.size() - fit.kept(), fit.answers, fit.kind,
      fit.options.curve == FittedCurve::kLine ? "line" : "sigmoid", fit.jnd.low, fit.jnd.high, fit.design);
}

std::string judges_text(const ExperimentFit& fit) {
  Table table;
  table.column("judge", Align::kLeft);
  for (const char* header : {"answers", "right %", "left %", "late", "catch trials"}) table.column(header);
  table.column("", Align::kLeft);
  for (const FittedJudge& j : fit.judges) {
    const double n = std::max(j.counts.answers, 1u);
    table.row({printable(j.judge), std::to_string(j.counts.answers), fixed(100 * j.right / n, 0),
               fixed(100 * j.counts.left / n, 0), std::to_string(j.late),
               fmt::format("{} of {}", j.counts.caught, j.counts.catches), verdict_text(j)});
  }
  return table.text();
}

std::string conditions_text(const ExperimentFit& fit) {
  Table table;
  for (const char* header : {"displayed px", "answers", "JND", "95 % from", "to", "slope", "lapse %",
                             "deviance", "levels", "JND of the line"})
    table.column(header);
  for (std::size_t c = 0; c < fit.sizes_px.size(); ++c) {
    const ConditionFit& f = fit.study.conditions[c];
    std::uint64_t answers = 0;
    for (const LevelCount& l : f.counts) answers += l.answers;
    table.row({shortest(fit.sizes_px[c]), std::to_string(answers), fixed(f.threshold.value, 4),
               fixed(f.threshold.low, 4), fixed(f.threshold.high, 4), fixed(f.sigmoid.curve.slope, 1),
               fixed(100 * f.sigmoid.curve.lapse, 1), fixed(f.sigmoid.deviance, 1),
               std::to_string(f.counts.size()),
               std::isfinite(f.line.threshold) ? fixed(f.line.threshold, 4) : "-"});
  }
  return table.text();
}

}  // namespace

std::string jnd_profile_json(const ExperimentFit& fit) {
  Json profile{{"version", 1},
               {"title", fit.kind},
               {"method", method_text(fit)},
               {"jnd", std::round(fit.jnd.value * 1e4) / 1e4},
               {"reference_px", fit.reference_px},
               {"distance_exponent", fit.distance_exponent}};
  if (fit.kind == name_of(StimulusKind::kMesh)) profile["statistic"] = "p95";
  return dump_json(profile, kDocument) + "\n";
}

std::string fit_json(const ExperimentFit& fit) {
  Json judges = Json::array(), conditions = Json::array();
  for (const FittedJudge& j : fit.judges) judges.push_back(judge_json(j));
  for (std::size_t c = 0; c < fit.sizes_px.size(); ++c)
    conditions.push_back(condition_json(fit.study.conditions[c], fit.sizes_px[c]));
  const Json out{{"version", 1},
                 {"design", fit.design},
                 {"kind", fit.kind},
                 {"curve", fit.options.curve == FittedCurve::kLine ? "line" : "sigmoid"},
                 {"found", fit.found},
                 {"verdict", fit.verdict},
                 {"jnd", estimate_json(fit.jnd)},
                 {"reference_px", fit.reference_px},
                 {"distance_exponent", fit.distance_exponent},
                 {"measured_exponent", estimate_json(fit.study.law.exponent)},
                 {"distance_verdict", fit.distance_verdict},
                 {"answers", fit.answers},
                 {"draws", fit.options.draws},
                 {"drawn", fit.study.by_judges ? "judges" : "answers"},
                 {"judges", std::move(judges)},
                 {"conditions", std::move(conditions)}};
  return out.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string fit_text(const ExperimentFit& fit) {
  return fmt::format("Experiment {}, {}: {} of {} judges, {} answers\n{}\n{}\n{}\n{}\n", fit.design, fit.kind,
                     fit.kept(), fit.judges.size(), fit.answers, judges_text(fit), conditions_text(fit),
                     fit.verdict, fit.distance_verdict);
}

}  // namespace texmesh
