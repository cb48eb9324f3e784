// The documents of an experiment: design.json, which says what judges are asked, and what they answered.
#include "lab/experiment/design.h"

#include <fmt/format.h>

#include <map>
#include <set>
#include <tuple>

#include "format/base/bounded_json.h"
#include "format/base/errors.h"
#include "format/base/json_fields.h"
#include "format/base/sha256.h"
#include "format/base/text_bytes.h"
#include "format/rules/split_mix.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kIdDigits = 16;
constexpr std::uint64_t kMaxDesignBytes = 16u << 20;

/// What `read` returns. Its FormatErrors become InputErrors {file, JSON pointer, ...}.
template <class Read>
auto read_document(const std::string& file, Read&& read) {
  try {
    return std::forward<Read>(read)();
  } catch (const FormatError& e) {
    throw InputError(file, e.place().empty() ? "/" : e.place(), e.expected(), e.found());
  }
}

/// Fails at `at` when the object has a field of another name. What is no object is left to its reader.
void check_field_names(const nlohmann::json& object, std::initializer_list<std::string_view> known,
                       const JsonAt& at) {
  if (!object.is_object()) return;
  for (const auto& [name, value] : object.items())
    if (std::ranges::find(known, name) == known.end())
      at.fail("only known fields", "\"" + name.substr(0, 40) + "\"");
}

/// Names of pictures, drawn once for each picture.
class PictureNames {
 public:
  explicit PictureNames(std::uint64_t seed) : random_(seed) {}
  enum Role : std::uint8_t { kReference, kSame, kChanged };
  const std::string& of(std::uint32_t condition, std::uint32_t object, Role role, std::uint32_t level) {
    std::string& name = names_[{condition, object, role, level}];
    if (name.empty()) name = fmt::format("{:016x}.png", random_.bits());
    return name;
  }

 private:
  SplitMix random_;
  std::map<std::tuple<std::uint32_t, std::uint32_t, Role, std::uint32_t>, std::string> names_;
};

ExperimentTrial trial_of(const ExperimentDesign& design, std::uint32_t condition, std::uint32_t level,
                         std::uint32_t object, PictureNames& names) {
  ExperimentTrial t;
  t.condition = condition, t.object = object, t.level_index = level;
  t.is_catch = level == design.levels.size();
  t.level = !t.is_catch ? design.levels[level] : design.options.move ? 0 : kCatchLevel;
  t.reference = names.of(condition, object, PictureNames::kReference, 0);
  if (design.options.move) {
    for (std::uint32_t place = 0; place < design.conditions.size(); ++place)
      t.moved.push_back(names.of(place, object, PictureNames::kChanged, level));
    return t;
  }
  t.same = names.of(condition, object, PictureNames::kSame, 0);
  t.changed = names.of(condition, object, PictureNames::kChanged, level);
  return t;
}

/// Half of them true (of an odd number one more or less), in any order.
std::vector<bool> balanced_sides(std::size_t count, SplitMix& random) {
  std::vector<std::uint8_t> sides;
  const std::size_t first = random.below(2);
  for (std::size_t k = 0; k < count; ++k) sides.push_back(static_cast<std::uint8_t>((k + first) % 2));
  random.shuffle(sides);
  return {sides.begin(), sides.end()};
}

/// Trials of one cell: a level at a size.
using Cells = std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::uint32_t>>;

std::vector<std::uint32_t> draw_order(const ExperimentDesign& design, const Cells& cells, SplitMix& random) {
  const auto repeats = static_cast<std::size_t>(design.options.repeats);
  std::vector<std::vector<std::uint32_t>> blocks(repeats);
  for (const auto& [cell, trials] : cells) {
    std::vector<std::uint32_t> drawn = trials;
    random.shuffle(drawn);
    const std::vector<bool> right = balanced_sides(drawn.size(), random);
    // Those of a level: one a block. Catch trials: spread over the blocks.
    for (std::size_t k = 0; k < drawn.size(); ++k)
      blocks[k * repeats / drawn.size()].push_back(2 * drawn[k] + (right[k] ? 1 : 0));
  }
  std::vector<std::uint32_t> order;
  for (std::vector<std::uint32_t>& block : blocks) {
    random.shuffle(block);
    order.insert(order.end(), block.begin(), block.end());
  }
  return order;
}

Json trials_json(const ExperimentDesign& design) {
  Json list = Json::array();
  for (const ExperimentTrial& t : design.trials) {
    Json trial{
        {"condition", t.condition}, {"level", t.level}, {"catch", t.is_catch}, {"reference", t.reference}};
    if (t.moved.empty())
      trial["same"] = t.same, trial["changed"] = t.changed;
    else
      trial["moved"] = t.moved;
    list.push_back(std::move(trial));
  }
  return list;
}

Json design_json(const ExperimentDesign& design) {
  const ExperimentOptions& o = design.options;
  Json conditions = Json::array();
  for (const ExperimentCondition& c : design.conditions)
    conditions.push_back({{"displayed_px", c.displayed_px}, {"frame_px", c.frame_px}});
  return {{"version", 1},
          {"title", o.title},
          {"kind", name_of(o.kind)},
          {"consent", o.consent},
          {"post_url", o.post_url},
          {"seed", o.seed},
          {"time_limit_s", o.time_limit_s},
          {"pause_s", o.pause_s},
          {"pixels_per_degree", o.pixels_per_degree},
          {"views", o.views},
          {"background", design.background},
          {"levels", design.levels},
          {"conditions", std::move(conditions)},
          {"trials", trials_json(design)},
          {"orders", design.orders}};
}

std::string id_of(const Json& without_id, const std::string& file) {
  const std::string text = dump_json(without_id, file);
  return to_hex(sha256(text_bytes(text))).substr(0, kIdDigits);
}

DesignKey key_of(const nlohmann::json& root, const std::string& file) {
  const JsonAt at(root, file);
  at["version"].integer(1, 1);
  DesignKey key;
  key.id = at["id"].text(kIdDigits);
  key.kind = at["kind"].text(20);
  std::vector<double> sizes;
  const JsonAt conditions = at["conditions"], trials = at["trials"];
  for (std::size_t c = 0, n = conditions.array(1, kPlaces); c < n; ++c)
    sizes.push_back(conditions[c]["displayed_px"].number(1, 100000));
  const bool moves = trials.array(1, kMostTrials) > 0 && trials[0].has("moved");
  for (std::size_t t = 0, n = trials.array(1, kMostTrials); t < n; ++t)
    key.trials.push_back({sizes[trials[t]["condition"].integer(0, sizes.size() - 1)],
                          trials[t]["level"].number(moves ? 0 : kLeastLevel, kMostLevel),
                          trials[t]["catch"].boolean()});
  if (moves) key.places_px = sizes;
  return key;
}

}  // namespace

void plan_trials(ExperimentDesign& design) {
  const ExperimentOptions& o = design.options;
  SplitMix random(o.seed);
  PictureNames names(random.bits());
  const auto levels = static_cast<std::uint32_t>(design.levels.size());
  const auto objects = static_cast<std::uint32_t>(o.kind == StimulusKind::kMesh ? 1 : o.objects);
  Cells cells;
  // What moves is asked once, not at every place.
  for (std::uint32_t c = 0; c < (o.move ? 1 : design.conditions.size()); ++c)
    for (std::uint32_t level = 0; level <= levels; ++level) {
      const auto count = static_cast<std::uint32_t>(level < levels ? o.repeats : o.catches);
      for (std::uint32_t k = 0; k < count; ++k) {
        cells[{c, level}].push_back(static_cast<std::uint32_t>(design.trials.size()));
        design.trials.push_back(trial_of(design, c, level, (k + level) % objects, names));
      }
    }
  for (int k = 0; k < o.orders; ++k) design.orders.push_back(draw_order(design, cells, random));
}

std::string write_design(ExperimentDesign& design) {
  Json json = design_json(design);
  design.id = id_of(json, "design.json");
  json["id"] = design.id;
  return dump_json(json, "design.json") + "\n";
}

DesignKey read_design(std::span<const std::uint8_t> json, const std::string& file) {
  return read_document(file, [&] {
    const nlohmann::json checked = parse_json(json, file, kMaxDesignBytes);
    DesignKey key = key_of(checked, file);
    Json rest = parse_bounded_json(json, file, 8);
    rest.erase("id");
    if (const std::string id = id_of(rest, file); id != key.id)
      throw InputError(file, "/id", id + ", the digest of the rest", key.id + ": the design was changed");
    return key;
  });
}

namespace {

constexpr std::size_t kMaxName = 32;
constexpr double kMostMs = 1e8;

/// One of two words; true for the second.
bool read_choice(const JsonAt& at, const std::string& first, const std::string& second) {
  const std::string word = at.text(10);
  if (word != first && word != second) at.fail(first + " or " + second, word);
  return word == second;
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

ExperimentAnswer read_answer(const nlohmann::json& answer, const JsonAt& at, const ExperimentResults& of) {
  const std::size_t places = of.places_px.size();
  check_field_names(answer,
                    {"trial", "displayed_px", "level", "catch", "ms", "late", places ? "began" : "side",
                     places ? "place" : "chosen"},
                    at);
  ExperimentAnswer out;
  out.trial = static_cast<std::uint32_t>(at["trial"].integer(0, of.trials - 1));
  out.displayed_px = at["displayed_px"].number(1, 100000);
  out.level = at["level"].number(places ? 0 : kLeastLevel, kMostLevel);
  out.is_catch = at["catch"].boolean();
  out.same_on_right =
      places ? read_choice(at["began"], "near", "far") : read_choice(at["side"], "left", "right");
  if (places) out.place = static_cast<std::uint32_t>(at["place"].integer(0, places - 1));
  out.chose_right = places ? 2 * out.place >= places : read_choice(at["chosen"], "left", "right");
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
      root,
      {"version", "design", "kind", "judge", "order", "date", "display", "trials", "places_px", "answers"},
      at);
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
  if (at.has("places_px"))
    for (std::size_t k = 0, n = at["places_px"].array(2, kPlaces); k < n; ++k)
      out.places_px.push_back(at["places_px"][k].number(1, k == 0 ? 100000 : out.places_px.back()));
  const JsonAt answers = at["answers"];
  std::set<std::uint32_t> seen;
  for (std::size_t k = 0, n = answers.array(0, out.trials); k < n; ++k) {
    out.answers.push_back(read_answer(root["answers"][k], answers[k], out));
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
