// From judges' answers to what they can just tell: the fit, its documents, and its page.
#include "lab/experiment/fit_experiment.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "format/base/json_fields.h"
#include "format/base/portable_math.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"
#include "tools/publish/pages/page.h"

namespace texmesh {
namespace {

using Matches = decltype(ExperimentFit::matches);
/// What every file must say of a trial.
using TrialKeys = std::map<std::uint32_t, DesignKey::Trial>;

void check_trials(const ExperimentResults& results, TrialKeys& keys) {
  for (std::size_t k = 0; k < results.answers.size(); ++k) {
    const ExperimentAnswer& a = results.answers[k];
    const auto [at, is_new] =
        keys.try_emplace(a.trial, DesignKey::Trial{a.displayed_px, a.level, a.is_catch});
    const DesignKey::Trial& t = at->second;
    if (t.displayed_px == a.displayed_px && t.level == a.level && t.is_catch == a.is_catch) continue;
    const auto text = [](double px, double level, bool is_catch) {
      return fmt::format("a change of {:g} at {:g} px{}", level, px, is_catch ? " as a catch trial" : "");
    };
    throw InputError(results.file, fmt::format("/answers/{}", k),
                     text(t.displayed_px, t.level, t.is_catch) + fmt::format(" in trial {}", a.trial),
                     text(a.displayed_px, a.level, a.is_catch));
  }
}

void check_files(const std::vector<ExperimentResults>& results, const std::optional<DesignKey>& key) {
  if (results.empty()) throw InputError("results", "", "at least one file", "none");
  const ExperimentResults& first = results.front();
  TrialKeys keys;
  if (key)
    for (std::uint32_t t = 0; t < key->trials.size(); ++t) keys[t] = key->trials[t];
  for (const ExperimentResults& r : results) {
    const std::string& wanted = key ? key->id : first.design;
    if (r.design != wanted)
      throw InputError(r.file, "/design", wanted + (key ? ", the given design" : ", as " + first.file),
                       r.design + ", another experiment");
    if (const std::size_t trials = key ? key->trials.size() : first.trials; r.trials != trials)
      throw InputError(r.file, "/trials", std::to_string(trials), std::to_string(r.trials));
    if (r.kind != (key ? key->kind : first.kind))
      throw InputError(r.file, "/kind", key ? key->kind : first.kind, r.kind);
    if (r.places_px != (key ? key->places_px : first.places_px))
      throw InputError(r.file, "/places_px", "the places of the experiment", "others");
    check_trials(r, keys);
  }
}

FittedJudge screened(const ExperimentResults& results, const JudgeLimits& limits) {
  FittedJudge judge{results.file, results.judge, {}, 0, 0, JudgeVerdict::kKept, false};
  for (const ExperimentAnswer& a : results.answers) {
    const bool moved = !results.places_px.empty();
    // An unchanged object looks alike where it is nearest; half of the objects begin in the farther half.
    const bool right = moved ? !a.is_catch || a.place <= kPlacesAnOctave : a.right();
    ++judge.counts.answers;
    judge.counts.left += moved ? a.right() : !a.chose_right;
    judge.counts.catches += a.is_catch;
    judge.counts.caught += a.is_catch && right;
    judge.right += right;
    judge.late += a.late;
  }
  judge.verdict = screen_judge(judge.counts, limits);
  return judge;
}

JudgeTable table_of(const ExperimentResults& results, const std::vector<double>& sizes_px) {
  std::vector<std::map<double, LevelCount>> counts(sizes_px.size());
  const auto add = [&counts](std::size_t size, double level, std::uint32_t answers, std::uint32_t right) {
    LevelCount& count = counts[size][level];
    count.level = level, count.answers += answers, count.right += right;
  };
  for (const ExperimentAnswer& a : results.answers) {
    if (a.is_catch) continue;
    // A move tells of every size whether a difference is seen. Who sees none and has to choose is right once
    // in two.
    for (std::size_t c = 0; c < sizes_px.size(); ++c)
      if (!results.places_px.empty())
        add(c, a.level, 2, sizes_px[c] > results.places_px[a.place] ? 2 : 1);
      else if (sizes_px[c] == a.displayed_px)
        add(c, a.level, 1, a.right());
  }
  JudgeTable out;
  for (const auto& by_level : counts) {
    out.conditions.emplace_back();
    for (const auto& [level, count] : by_level) out.conditions.back().push_back(count);
  }
  return out;
}

std::vector<double> sizes_of(const std::vector<const ExperimentResults*>& kept) {
  std::vector<double> sizes;
  for (const ExperimentResults* r : kept)
    for (const ExperimentAnswer& a : r->answers)
      if (!a.is_catch) sizes.push_back(a.displayed_px);
  std::ranges::sort(sizes);
  sizes.erase(std::ranges::unique(sizes).begin(), sizes.end());
  return sizes;
}

/// Of a move's sizes those at which some changes are seen and others are not; all where there are none.
std::vector<double> telling_sizes(const std::vector<const ExperimentResults*>& kept, const Matches& matches) {
  std::vector<double> sizes;
  for (const double px : kept.front()->places_px)
    if (px < matches.front().second.value && px > matches.back().second.value) sizes.push_back(px);
  if (sizes.empty()) sizes = kept.front()->places_px;
  std::ranges::reverse(sizes);
  return sizes;
}

Matches matches_of(const std::vector<const ExperimentResults*>& kept) {
  std::map<double, std::vector<double>> sizes;
  for (const ExperimentResults* r : kept)
    for (const ExperimentAnswer& a : r->answers)
      if (!a.is_catch && !r->places_px.empty()) sizes[a.level].push_back(r->places_px[a.place]);
  Matches out;
  for (auto& [level, px] : sizes) {
    std::ranges::sort(px);
    const auto at = [&px = px](std::size_t quarter) { return px[(px.size() - 1) * quarter / 4]; };
    out.push_back({{level, static_cast<std::uint32_t>(px.size()), 0}, {at(2), at(1), at(3)}});
  }
  return out;
}

std::string bounds_text(const Estimate& e, int digits) {
  return fmt::format("{:.{}f}, 95 % from {:.{}f} to {:.{}f}", e.value, digits, e.low, digits, e.high, digits);
}

std::string distance_text(const ExperimentFit& fit) {
  const DistanceLaw& law = fit.study.law;
  if (fit.sizes_px.size() < 2)
    return "One displayed size says nothing about distance: the profile holds at every distance, as the thesis prints.";
  const std::string e = bounds_text(law.exponent, 2);
  if (law.may_be_printed() && law.may_be_inverse())
    return "Undecided: the exponent of distance is " + e +
           ", which may be 0 (as printed) or 1 (512 / D). The profile holds at every distance until more judges "
           "have answered.";
  if (law.may_be_printed())
    return "The threshold does not follow the displayed size (exponent " + e + "): as the thesis prints.";
  if (law.may_be_inverse())
    return "The threshold follows the displayed size (exponent " + e + "): 1 / D, not as the thesis prints.";
  return "The threshold follows the displayed size with an exponent of " + e +
         ": neither as printed nor 1 / D.";
}

void judge_sigmoid(ExperimentFit& fit) {
  fit.jnd = fit.study.law.jnd;
  fit.found = fit.study.within;
  if (fit.sizes_px.size() > 1 && !fit.study.law.may_be_printed())
    fit.distance_exponent = std::clamp(std::round(fit.study.law.exponent.value * 100) / 100, 0.0, 2.0);
}

void judge_line(ExperimentFit& fit) {
  const ConditionFit& all = fit.study.pooled;
  fit.jnd = all.line_threshold;
  fit.found = std::isfinite(fit.jnd.value) && fit.jnd.value >= all.counts.front().level &&
              fit.jnd.value <= all.counts.back().level;
}

std::string found_text(const ExperimentFit& fit) {
  if (fit.found)
    return fmt::format("75 % of the answers are right at a change of {}, shown {:g} px high.",
                       bounds_text(fit.jnd, 4), fit.reference_px);
  const std::vector<LevelCount>& c = fit.study.pooled.counts;
  const auto share = [](const LevelCount& l) { return 100.0 * l.right / l.answers; };
  return fmt::format(
      "No threshold: 75 % right lies outside the levels for at least one displayed size. At the smallest level, "
      "{:g}, {:.0f} % are right, at the largest, {:g}, {:.0f} %.",
      c.front().level, share(c.front()), c.back().level, share(c.back()));
}

[[noreturn]] void fail_without_judges(const ExperimentFit& fit) {
  std::string why;
  for (const FittedJudge& j : fit.judges) why += fmt::format("; {}: {}", j.file, verdict_text(j));
  throw InputError("results", "", "a judge whose answers can be used",
                   fmt::format("none of {}{}", fit.judges.size(), why.substr(0, 2000)));
}

}  // namespace

std::size_t ExperimentFit::kept() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(judges, [](const FittedJudge& j) { return j.kept(); }));
}

std::string verdict_text(const FittedJudge& j) {
  if (j.repeated) return "left out: an earlier file holds the same answers";
  switch (j.verdict) {
    case JudgeVerdict::kTooFew:
      return fmt::format("left out: {} answers with {} catch trials are too few", j.counts.answers,
                         j.counts.catches);
    case JudgeVerdict::kOneSide:
      return fmt::format("left out: {} of {} answers are \"left\"", j.counts.left, j.counts.answers);
    case JudgeVerdict::kInattentive:
      return fmt::format("left out: {} of {} catch trials are right", j.counts.caught, j.counts.catches);
    case JudgeVerdict::kKept:
      break;
  }
  return "kept";
}

ExperimentFit fit_experiment(const std::vector<ExperimentResults>& results,
                             const std::optional<DesignKey>& key, const FitOptions& options,
                             const RunContext& context) {
  check_files(results, key);
  ExperimentFit fit;
  fit.design = results.front().design;
  fit.kind = results.front().kind;
  fit.options = options;
  std::vector<const ExperimentResults*> kept;
  for (const ExperimentResults& r : results) {
    FittedJudge judge = screened(r, options.limits);
    judge.repeated = !r.answers.empty() && std::ranges::any_of(kept, [&r](const ExperimentResults* other) {
      return other->answers == r.answers;
    });
    fit.judges.push_back(judge);
    if (judge.kept()) kept.push_back(&r), fit.answers += judge.counts.answers - judge.counts.catches;
  }
  fit.matches = matches_of(kept);
  fit.sizes_px = fit.matches.empty() ? sizes_of(kept) : telling_sizes(kept, fit.matches);
  if (kept.empty() || fit.sizes_px.empty()) fail_without_judges(fit);
  const bool by_judges = kept.size() >= kLeastJudgesToDraw;
  std::vector<JudgeTable> tables;
  for (const ExperimentResults* r : kept) {
    // What a move tells of all sizes is drawn as one.
    ExperimentResults one = *r;
    for (std::size_t k = 0, n = by_judges || r->places_px.empty() ? 1 : r->answers.size(); k < n; ++k) {
      if (n > 1) one.answers = {r->answers[k]};
      tables.push_back(table_of(one, fit.sizes_px));
    }
  }
  fit.study = study_thresholds(tables, fit.sizes_px, options.draws, options.seed, context);
  fit.study.by_judges = by_judges;
  fit.reference_px = std::round(fit.study.law.reference_px);
  if (options.curve == FittedCurve::kLine)
    judge_line(fit);
  else
    judge_sigmoid(fit);
  fit.verdict = found_text(fit);
  fit.distance_verdict = distance_text(fit);
  return fit;
}

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

std::string method_text(const ExperimentFit& fit) {
  return fmt::format(
      "{} judges ({} left out), {} answers to {}, {}, 75 % of a {}, 95 % bounds {:.4f} to {:.4f}; experiment {}",
      fit.kept(), fit.judges.size() - fit.kept(), fit.answers, fit.kind,
      fit.matches.empty() ? "2AFC with reference" : "moved until alike",
      fit.options.curve == FittedCurve::kLine ? "line" : "sigmoid", fit.jnd.low, fit.jnd.high, fit.design);
}

Table judges_table(const ExperimentFit& fit) {
  Table table("One row a file of results",
              {Column::data("file"), Column::text("judge", "judge"), {"answers", 0, "answers"}});
  table.column({"right %", 0, "right"}), table.column({"left %", 0, "left"});
  table.column({"late", 0, "late"}), table.column({"catch trials right", 0, "caught"});
  table.column(Column::data("catches")), table.column(Column::text("verdict", "verdict"));
  for (const FittedJudge& j : fit.judges) {
    const auto of_all = [&j](std::uint32_t part) {
      return Cell(part, fmt::format("{:.0f}", 100.0 * part / std::max(j.counts.answers, 1u)));
    };
    table.row({j.file, j.judge, j.counts.answers, of_all(j.right), of_all(j.counts.left), j.late,
               Cell(j.counts.caught, fmt::format("{} of {}", j.counts.caught, j.counts.catches)),
               j.counts.catches, Cell(word_of(j), verdict_text(j))});
  }
  return table;
}

Table conditions_table(const ExperimentFit& fit) {
  Table table{"",
              {{"displayed px", kShortest},
               "answers",
               {"JND", 4},
               {"95 % from", 4},
               {"to", 4},
               {"slope", 1},
               {"lapse %", percent_form()},
               {"deviance", 1},
               "levels",
               {"JND of the line", 4}}};
  for (std::size_t c = 0; c < fit.sizes_px.size(); ++c) {
    const ConditionFit& f = fit.study.conditions[c];
    std::uint64_t answers = 0;
    for (const LevelCount& l : f.counts) answers += l.answers;
    table.row({fit.sizes_px[c], answers, f.threshold.value, f.threshold.low, f.threshold.high,
               f.sigmoid.curve.slope, f.sigmoid.curve.lapse, f.sigmoid.deviance, f.counts.size(),
               std::isfinite(f.line.threshold) ? Cell(f.line.threshold) : Cell("-")});
  }
  return table;
}

Table matches_table(const ExperimentFit& fit) {
  Table table(
      "Where a changed object looks like the unchanged one (6.2), in px; half of the answers lie between",
      {{"change", kShortest, "level"},
       {"answers", 0, "answers"},
       {"median", 1, "displayed_px"},
       {"from", 1, "low_px"},
       {"to", 1, "high_px"}});
  for (const auto& [of, px] : fit.matches) table.row({of.level, of.answers, px.value, px.low, px.high});
  return table;
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
  Json conditions = Json::array();
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
                 {"judges", judges_table(fit).json()},
                 {"matches", matches_table(fit).json()},
                 {"conditions", std::move(conditions)}};
  return out.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string fit_text(const ExperimentFit& fit) {
  return fmt::format("Experiment {}, {}: {} of {} judges, {} answers\n{}\n{}{}\n{}\n{}\n", fit.design,
                     fit.kind, fit.kept(), fit.judges.size(), fit.answers, judges_table(fit).text(),
                     fit.matches.empty() ? "" : matches_table(fit).text() + "\n",
                     conditions_table(fit).text(), fit.verdict, fit.distance_verdict);
}

namespace {

constexpr int kCurvePoints = 80;

/// Shares of right answers at one displayed size, with both curves; levels in percent.
std::string condition_plot(const ConditionFit& fit, double displayed_px) {
  const double low = fit.counts.front().level, high = std::max(fit.counts.back().level, 1.01 * low);
  Plot plot{fmt::format("share of right answers against the change, {:g} px", displayed_px),
            "change [%]",
            "right answers [%]",
            100 * low / 1.2,
            100 * high * 1.2,
            100,
            0,
            false,
            {}};
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
  Plot plot{"threshold against the displayed size",
            "displayed size [px]",
            "just noticeable change [%]",
            fit.sizes_px.front() / 1.2,
            fit.sizes_px.back() * 1.2,
            0,
            0,
            false,
            {}};
  const auto law = [&](double exponent, double px) {
    return 100 * fit.study.law.jnd.value *
           portable::exp(exponent * portable::log(fit.study.law.reference_px / px));
  };
  PlotSeries found{"thresholds", "a", {}, false, false, true},
      printed{"as printed", "c", {}, false, true, false}, inverse{"512 / D", "b", {}, false, true, false};
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

/// Fig. 6.4.
std::string matches_plot(const ExperimentFit& fit) {
  Plot plot{"size at which a changed object looks like the unchanged one, against the change",
            "change [%]",
            "displayed size [px]",
            100 * fit.matches.front().first.level / 1.2,
            100 * fit.matches.back().first.level * 1.2,
            0,
            0,
            false,
            {}};
  PlotSeries medians{"median", "a", {}, false, false, true};
  for (const auto& [of, px] : fit.matches) {
    medians.points.emplace_back(100 * of.level, px.value);
    plot.series.push_back({"", "a", {{100 * of.level, px.low}, {100 * of.level, px.high}}, true});
    plot.y_high = std::max(plot.y_high, px.high);
  }
  plot.series.push_back(medians);
  return plot.svg();
}

}  // namespace

std::string fit_page(const ExperimentFit& fit) {
  std::string body = fmt::format(
      "<header><div><h1>What {} judges could just tell</h1><p class=\"verdict{}\">{}</p><p>{}</p>"
      "<p class=\"quiet\">Experiment {}, {}; {} answers without catch trials. Bounds hold 95 % of {} draws of {} "
      "with replacement.</p></div></header>\n<main>\n",
      fit.kept(), fit.found ? "" : " bad", markup_escaped(fit.verdict), markup_escaped(fit.distance_verdict),
      fit.design, fit.kind, fit.answers, fit.options.draws, fit.study.by_judges ? "judges" : "answers");
  if (!fit.matches.empty())
    body += html_section("matches", "Where both look alike",
                         "<figure>" + matches_plot(fit) + "</figure>\n" + matches_table(fit).html());
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
  body += html_section("judges", "Judges", judges_table(fit).html()) + "</main>\n";
  return html_page("What judges could just tell", body);
}

}  // namespace texmesh
