#include "lab/experiment/results.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "lab/experiment/design.h"
#include "pipeline/compile/user_document.h"

namespace texmesh {
namespace {

constexpr std::size_t kMaxName = 32;
constexpr double kMostMs = 1e8;

/// One of two words; true for the second.
bool read_side(const JsonAt& at) {
  const std::string side = at.text(10);
  if (side != "left" && side != "right") at.fail("left or right", side);
  return side == "right";
}

std::string read_word(const JsonAt& at, std::size_t most, std::string_view characters) {
  const std::string text = at.text(most);
  if (text.empty() || text.find_first_not_of(characters) != std::string::npos)
    at.fail("1 to " + std::to_string(most) + " of the characters " + std::string(characters), text);
  return text;
}

void check_display(const nlohmann::json& display, const JsonAt& at) {
  check_field_names(display,
                    {"css_px_per_mm", "device_pixel_ratio", "zoom", "pixels_per_degree", "distance_mm",
                     "layout", "width_px", "height_px", "touch"},
                    at);
  at["css_px_per_mm"].number(0.1, 100);
  at["device_pixel_ratio"].number(0.1, 20);
  at["zoom"].integer(1, 100);
  at["pixels_per_degree"].number(1, 1000);
  at["distance_mm"].number(1, 100000);
  at["layout"].text(20);
  at["width_px"].integer(1, 100000);
  at["height_px"].integer(1, 100000);
  at["touch"].boolean();
}

ExperimentAnswer read_answer(const nlohmann::json& answer, const JsonAt& at, std::uint32_t trials) {
  check_field_names(answer, {"trial", "displayed_px", "level", "catch", "side", "chosen", "ms", "late"}, at);
  ExperimentAnswer out;
  out.trial = static_cast<std::uint32_t>(at["trial"].integer(0, trials - 1));
  out.displayed_px = at["displayed_px"].number(1, 100000);
  out.level = at["level"].number(kLeastLevel, kMostLevel);
  out.is_catch = at["catch"].boolean();
  out.same_on_right = read_side(at["side"]);
  out.chose_right = read_side(at["chosen"]);
  out.seconds = at["ms"].number(0, kMostMs) / 1000;
  out.late = at["late"].boolean();
  return out;
}

ExperimentResults results_of(const nlohmann::json& root, const std::string& file) {
  constexpr std::string_view kHex = "0123456789abcdef",
                             kNames = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
  const JsonAt at(root, file);
  at["version"].integer(1, 1);
  check_field_names(
      root, {"version", "design", "kind", "judge", "order", "date", "display", "trials", "answers"}, at);
  ExperimentResults out;
  out.file = file;
  out.design = read_word(at["design"], 16, kHex);
  if (out.design.size() != 16) at["design"].fail("16 hexadecimal digits", out.design);
  out.kind = at["kind"].text(20);
  if (std::ranges::find(kStimulusKinds, out.kind) == kStimulusKinds.end())
    at["kind"].fail("ellipsoids, quadrics or mesh", out.kind);
  out.judge = read_word(at["judge"], kMaxName, kNames);
  at["order"].integer(0, 1000);
  at["date"].text(10);
  check_display(root["display"], at["display"]);
  out.trials = static_cast<std::uint32_t>(at["trials"].integer(1, kMostTrials));
  const JsonAt answers = at["answers"];
  std::set<std::uint32_t> seen;
  for (std::size_t k = 0, n = answers.array(0, out.trials); k < n; ++k) {
    out.answers.push_back(read_answer(root["answers"][k], answers[k], out.trials));
    if (!seen.insert(out.answers.back().trial).second)
      answers[k]["trial"].fail("each trial once", std::to_string(out.answers.back().trial) + " again");
  }
  return out;
}

}  // namespace

ExperimentResults read_results(std::span<const std::uint8_t> json, const std::string& file) {
  return read_document(file, [&] { return results_of(parse_json(json, file, kMaxResultsBytes), file); });
}

}  // namespace texmesh
