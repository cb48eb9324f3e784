#pragma once
#include <cmath>
#include <string>
#include <vector>

#include "format/rules/split_mix.h"
#include "lab/experiment/design.h"

namespace texmesh::testing {

/// How a simulated judge answers.
struct SimulatedJudge {
  double threshold = 0.1;  // at 128 px
  double exponent = 0;     // of distance
  double slope = 5, lapse = 0.02;
  /// kLeftKey: of moves one who leaves the object where it begins.
  enum class Habit : std::uint8_t { kLooks, kLeftKey, kGuesses } habit = Habit::kLooks;
};

inline ExperimentDesign simulated_design(std::vector<double> sizes_px, int repeats, std::uint64_t seed = 1,
                                         bool move = false) {
  ExperimentDesign d;
  d.options.move = move;
  d.options.repeats = repeats, d.options.catches = 8, d.options.seed = seed;
  d.options.title = "t", d.options.consent = "c";
  d.background = "#7c7c7c";
  for (const double px : sizes_px) d.conditions.push_back({px, 100});
  d.levels = {0.03, 0.05, 0.07, 0.1, 0.14, 0.2, 0.28};
  plan_trials(d);
  write_design(d);
  return d;
}

/// The places of a move from `nearest_px`, each `a_place` times as large as the one before.
inline ExperimentDesign simulated_moves(double nearest_px, int repeats, double a_place = 0.87) {
  std::vector<double> places{nearest_px};
  while (places.size() < kPlaces) places.push_back(places.back() * a_place);
  return simulated_design(places, repeats, 1, true);
}

/// Where the judge sees no difference any more: at the first place at which the level is below the threshold.
inline std::uint32_t simulated_place(const ExperimentDesign& design, const SimulatedJudge& judge,
                                     const ExperimentTrial& trial, bool begins_far, SplitMix& random) {
  const auto last = static_cast<std::uint32_t>(design.conditions.size() - 1);
  if (judge.habit == SimulatedJudge::Habit::kLeftKey) return begins_far ? last : 0;
  if (judge.habit == SimulatedJudge::Habit::kGuesses)
    return static_cast<std::uint32_t>(random.below(last + 1));
  const double level = trial.level * (1 + 0.2 * (random.next() - 0.5));
  std::uint32_t place = 0;
  while (place < last &&
         level > judge.threshold * std::pow(128 / design.conditions[place].displayed_px, judge.exponent))
    ++place;
  return place;
}

/// Results as the page writes them, of the first `answers` trials of the judge's order.
inline ExperimentResults simulated_results(const ExperimentDesign& design, const SimulatedJudge& judge,
                                           std::uint64_t number, std::size_t answers = 1u << 30) {
  SplitMix random(number * 977 + 5);
  ExperimentResults out{"judge-" + std::to_string(number) + ".json",
                        design.id,
                        std::string(name_of(design.options.kind)),
                        "judge-" + std::to_string(number),
                        static_cast<std::uint32_t>(design.trials.size()),
                        {},
                        {}};
  if (design.options.move)
    for (const ExperimentCondition& c : design.conditions) out.places_px.push_back(c.displayed_px);
  for (const std::uint32_t code : design.orders[number % design.orders.size()]) {
    if (out.answers.size() >= answers) break;
    const ExperimentTrial& t = design.trials[code >> 1];
    const double px = design.conditions[t.condition].displayed_px;
    const double threshold = judge.threshold * std::pow(128 / px, judge.exponent);
    const double share =
        t.is_catch ? 1 : 0.5 + (0.5 - judge.lapse) / (1 + std::pow(threshold / t.level, judge.slope));
    ExperimentAnswer a{code >> 1, px, t.level, t.is_catch, (code & 1) == 1, false, 0, 2, false};
    if (design.options.move) {
      a.place = simulated_place(design, judge, t, a.same_on_right, random);
      a.chose_right = 2 * a.place >= design.conditions.size();
      out.answers.push_back(a);
      continue;
    }
    const bool right = random.next() < (judge.habit == SimulatedJudge::Habit::kGuesses ? 0.5 : share);
    a.chose_right = judge.habit == SimulatedJudge::Habit::kLeftKey ? false : right == a.same_on_right;
    out.answers.push_back(a);
  }
  return out;
}

inline std::string results_json(const ExperimentResults& r) {
  const auto flag = [](bool b) { return std::string(b ? "true" : "false"); };
  const auto side = [](bool right) { return std::string(right ? "\"right\"" : "\"left\""); };
  std::string places;
  for (const double px : r.places_px) {
    char text[40];
    std::snprintf(text, sizeof text, "%.17g", px);
    places += (places.empty() ? "" : ",") + std::string(text);
  }
  std::string out =
      R"({"version":1,"design":")" + r.design + R"(","kind":")" + r.kind + R"(","judge":")" + r.judge +
      R"(","order":0,"date":"2026-01-31","display":{"css_px_per_mm":3.78,"device_pixel_ratio":1,)" +
      R"("zoom":1,"pixels_per_degree":40,"distance_mm":606,"layout":"stacked","width_px":1280,)" +
      R"("height_px":800,"touch":false},"trials":)" + std::to_string(r.trials) +
      (places.empty() ? "" : ",\"places_px\":[" + places + "]") + R"(,"answers":[)";
  for (std::size_t k = 0; k < r.answers.size(); ++k) {
    const ExperimentAnswer& a = r.answers[k];
    char level[40], px[40];
    std::snprintf(level, sizeof level, "%.17g", a.level);
    std::snprintf(px, sizeof px, "%.17g", a.displayed_px);
    out += (k ? "," : "") + std::string(R"({"trial":)") + std::to_string(a.trial) + R"(,"displayed_px":)" +
           px + R"(,"level":)" + level + R"(,"catch":)" + flag(a.is_catch) +
           (places.empty() ? R"(,"side":)" + side(a.same_on_right) + R"(,"chosen":)" + side(a.chose_right)
                           : std::string(R"(,"began":)") + (a.same_on_right ? R"("far")" : R"("near")") +
                                 R"(,"place":)" + std::to_string(a.place)) +
           R"(,"ms":2000,"late":)" + flag(a.late) + "}";
  }
  return out + "]}\n";
}

}  // namespace texmesh::testing
