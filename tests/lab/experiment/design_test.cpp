#include "lab/experiment/design.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "format/base/errors.h"

namespace texmesh::design_test {

ExperimentDesign planned(std::uint64_t seed = 1, int repeats = 6, int catches = 6) {
  ExperimentDesign d;
  d.options.seed = seed, d.options.repeats = repeats, d.options.catches = catches;
  d.options.title = "t", d.options.consent = "c";
  d.background = "#7c7c7c";
  d.conditions = {{64, 90}, {128, 180}};
  d.levels = {0.05, 0.1, 0.2};
  plan_trials(d);
  return d;
}

std::span<const std::uint8_t> bytes_of(const std::string& s) {
  return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()};
}

TEST(Design, EveryOrderAsksEveryTrialOnce) {
  const ExperimentDesign d = planned();
  EXPECT_EQ(d.trials.size(), 2u * (3 * 6 + 6));
  ASSERT_EQ(d.orders.size(), 8u);
  for (const auto& order : d.orders) {
    std::set<std::uint32_t> asked;
    for (const std::uint32_t code : order) asked.insert(code >> 1);
    EXPECT_EQ(asked.size(), d.trials.size());
    EXPECT_EQ(order.size(), d.trials.size());
    EXPECT_EQ(*asked.rbegin(), d.trials.size() - 1);
  }
  EXPECT_EQ(std::set<std::vector<std::uint32_t>>(d.orders.begin(), d.orders.end()).size(), d.orders.size());
}

TEST(Design, AMoveIsAskedOnceForAllItsPlaces) {
  ExperimentDesign d;
  d.options.move = true, d.options.repeats = 4, d.options.catches = 4, d.options.objects = 2;
  d.options.title = "t", d.options.consent = "c";
  d.background = "#7c7c7c";
  d.conditions = {{128, 180}, {64, 90}, {32, 45}};
  d.levels = {0.05, 0.1, 0.2};
  plan_trials(d);
  ASSERT_EQ(d.trials.size(), 4u * 4);
  std::set<std::string> names;
  for (const ExperimentTrial& t : d.trials) {
    EXPECT_EQ(t.condition, 0u);
    EXPECT_EQ(t.level == 0, t.is_catch);
    ASSERT_EQ(t.moved.size(), 3u);
    names.insert(t.moved.begin(), t.moved.end());
  }
  EXPECT_EQ(names.size(), 2u * 4 * 3);  // objects, levels and the unchanged one, places
  const DesignKey key = read_design(bytes_of(write_design(d)), "design.json");
  EXPECT_EQ(key.places_px, (std::vector<double>{128, 64, 32}));
  EXPECT_EQ(key.trials.size(), 16u);
}

TEST(Design, SidesAreBalancedWithinEveryLevelAndSize) {
  for (const int repeats : {6, 5, 1}) {
    const ExperimentDesign d = planned(3, repeats, 4);
    for (const auto& order : d.orders) {
      std::map<std::pair<std::uint32_t, double>, int> right_less_left;
      for (const std::uint32_t code : order) {
        const ExperimentTrial& t = d.trials[code >> 1];
        right_less_left[{t.condition, t.level}] += code & 1 ? 1 : -1;
      }
      for (const auto& [cell, difference] : right_less_left)
        EXPECT_LE(std::abs(difference), cell.second == kCatchLevel ? 0 : repeats % 2) << cell.second;
    }
  }
}

TEST(Design, EveryLevelOfEverySizeIsAskedBeforeAnyIsAskedAgain) {
  const ExperimentDesign d = planned(4, 6, 6);
  for (const auto& order : d.orders)
    for (std::size_t block = 0; block < 6; ++block) {
      std::set<std::pair<std::uint32_t, std::uint32_t>> cells;
      for (std::size_t k = 0; k < 8; ++k) {  // three levels and a catch trial of two sizes
        const ExperimentTrial& t = d.trials[order[8 * block + k] >> 1];
        cells.insert({t.condition, t.level_index});
      }
      EXPECT_EQ(cells.size(), 8u);
    }
}

TEST(Design, NamesTellNothing) {
  const ExperimentDesign d = planned();
  std::map<std::string, std::tuple<std::uint32_t, std::uint32_t, int, std::uint32_t>> meaning;
  for (const ExperimentTrial& t : d.trials) {
    int role = 0;
    for (const std::string& name : {t.reference, t.same, t.changed}) {
      ASSERT_EQ(name.size(), 20u);
      EXPECT_EQ(name.find_first_not_of("0123456789abcdef"), 16u) << name;
      const std::tuple what{t.condition, t.object, role, role == 2 ? t.level_index : 0};
      EXPECT_EQ(meaning.try_emplace(name, what).first->second, what);  // one name, one picture
      ++role;
    }
  }
  std::set<std::tuple<std::uint32_t, std::uint32_t, int, std::uint32_t>> pictures;
  for (const auto& [name, what] : meaning)
    EXPECT_TRUE(pictures.insert(what).second);  // one picture, one name
  EXPECT_NE(planned(1).trials[0].same, planned(2).trials[0].same);
}

TEST(Design, TheSeedDecides) {
  ExperimentDesign a = planned(7), b = planned(7), c = planned(8);
  EXPECT_EQ(write_design(a), write_design(b));
  EXPECT_EQ(a.id, b.id);
  write_design(c);
  EXPECT_NE(a.id, c.id);
  EXPECT_NE(a.orders, c.orders);
}

TEST(Design, IsReadAgainAndKnowsWhenItWasChanged) {
  ExperimentDesign d = planned();
  const std::string text = write_design(d);
  const DesignKey key = read_design(bytes_of(text), "design.json");
  EXPECT_EQ(key.id, d.id);
  EXPECT_EQ(key.kind, "quadrics");
  ASSERT_EQ(key.trials.size(), d.trials.size());
  for (std::size_t t = 0; t < key.trials.size(); ++t) {
    EXPECT_EQ(key.trials[t].level, d.trials[t].level);
    EXPECT_EQ(key.trials[t].is_catch, d.trials[t].is_catch);
    EXPECT_EQ(key.trials[t].displayed_px, d.conditions[d.trials[t].condition].displayed_px);
  }
  auto changed = nlohmann::ordered_json::parse(text);
  changed["trials"][0]["level"] = 0.051;
  const auto place = [](const std::string& json) -> std::string {
    try {
      read_design(bytes_of(json), "d");
    } catch (const InputError& e) {
      return e.place();
    }
    return "none";
  };
  EXPECT_EQ(place(changed.dump()), "/id");
  changed["trials"][0]["level"] = 7;
  EXPECT_EQ(place(changed.dump()), "/trials/0/level");
  changed["trials"][0].erase("level");
  EXPECT_EQ(place(changed.dump()), "/trials/0/level");
  for (const std::size_t cut : {0u, 1u, 100u, 2000u}) EXPECT_NE(place(text.substr(0, cut)), "none") << cut;
  EXPECT_NE(place(std::string(100000, '[')), "none");
}

}  // namespace texmesh::design_test
