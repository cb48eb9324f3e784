#include "lab/experiment/design.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "tests/lab/experiment/simulated_results.h"

namespace texmesh::results_test {

using nlohmann::json;

std::string good_text() {
  return testing::results_json(testing::simulated_results(testing::simulated_design({64, 128}, 2), {}, 1));
}

/// The place that the error names; "none" for no error.
std::string refused(const std::string& text) {
  try {
    read_results({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "r.json");
  } catch (const InputError& e) {
    EXPECT_EQ(e.file(), "r.json");
    EXPECT_FALSE(e.expected().empty() && e.found().empty());
    return e.place();
  }
  return "none";
}

std::string with(const std::string& pointer, const json& value) {
  json document = json::parse(good_text());
  document[json::json_pointer(pointer)] = value;
  return document.dump();
}

TEST(Results, AreReadAsTheyWereGiven) {
  const ExperimentResults given = testing::simulated_results(testing::simulated_design({64, 128}, 2), {}, 1);
  const std::string text = testing::results_json(given);
  const ExperimentResults read =
      read_results({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "r.json");
  EXPECT_EQ(read.design, given.design);
  EXPECT_EQ(read.judge, given.judge);
  EXPECT_EQ(read.trials, given.trials);
  EXPECT_EQ(read.answers, given.answers);
}

TEST(Results, OfMovesHoldPlaces) {
  const ExperimentResults given = testing::simulated_results(testing::simulated_moves(320, 1), {}, 1);
  json document = json::parse(testing::results_json(given));
  const auto read = [&document] {
    const std::string text = document.dump();
    return read_results({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "r.json");
  };
  EXPECT_EQ(read().places_px, given.places_px);
  EXPECT_EQ(read().answers, given.answers);
  document["places_px"][1] = 321;
  EXPECT_EQ(refused(document.dump()), "/places_px/1");  // larger than the nearest
  document["places_px"] = {320, 160};
  EXPECT_EQ(refused(document.dump()).rfind("/answers/", 0), 0u);  // a place that is not there
  document.erase("places_px");
  EXPECT_EQ(refused(document.dump()), "/answers/0");
}

TEST(Results, NumbersOutOfRangeAreRefusedWhereTheyStand) {
  for (const auto& [pointer, value] :
       std::vector<std::pair<std::string, json>>{{"/version", 2},
                                                 {"/design", "c0ffee"},
                                                 {"/design", "C3C197E459C3F293"},
                                                 {"/kind", "spheres"},
                                                 {"/judge", ""},
                                                 {"/judge", "a<b"},
                                                 {"/judge", std::string(33, 'a')},
                                                 {"/order", -1},
                                                 {"/order", 1e6},
                                                 {"/trials", 0},
                                                 {"/trials", 5001},
                                                 {"/display/zoom", 0},
                                                 {"/display/css_px_per_mm", 0},
                                                 {"/display/distance_mm", 1e9},
                                                 {"/display/touch", 1},
                                                 {"/answers/0/trial", 100000},
                                                 {"/answers/0/trial", -1},
                                                 {"/answers/0/trial", 0.5},
                                                 {"/answers/0/level", 0},
                                                 {"/answers/0/level", 1.5},
                                                 {"/answers/0/level", "0.1"},
                                                 {"/answers/0/level", nullptr},
                                                 {"/answers/0/displayed_px", 0},
                                                 {"/answers/0/side", "top"},
                                                 {"/answers/0/chosen", nullptr},
                                                 {"/answers/0/ms", -1},
                                                 {"/answers/0/ms", 1e12},
                                                 {"/answers/0/late", "no"}})
    EXPECT_EQ(refused(with(pointer, value)), pointer) << value;
  EXPECT_EQ(refused(with("/answers/0/extra", 1)), "/answers/0");
  EXPECT_EQ(refused(with("/display/extra", 1)), "/display");
  EXPECT_NE(refused(with("/extra", 1)), "none");
  EXPECT_EQ(refused(with("/answers", 5)), "/answers");
  EXPECT_EQ(refused(with("/answers/0", 5)), "/answers/0");
}

TEST(Results, EveryFieldMustBeThere) {
  const json good = json::parse(good_text());
  for (const auto& [name, value] : good.items()) {
    json less = good;
    less.erase(name);
    EXPECT_NE(refused(less.dump()), "none") << name;
  }
  for (const auto& [name, value] : good["answers"][0].items()) {
    json less = good;
    less["answers"][0].erase(name);
    EXPECT_NE(refused(less.dump()), "none") << name;
  }
}

TEST(Results, ATrialIsAnsweredOnce) {
  json twice = json::parse(good_text());
  twice["answers"][1] = twice["answers"][0];
  EXPECT_EQ(refused(twice.dump()), "/answers/1/trial");
  json many = json::parse(good_text());
  many["trials"] = 2;  // fewer than answers
  EXPECT_EQ(refused(many.dump()), "/answers");
}

TEST(Results, AnyBytesAreReadOrRefused) {
  const std::string good = good_text();
  SplitMix random(3);
  int refusals = 0;
  for (int k = 0; k < 3000; ++k) {
    std::string text = good;
    for (std::size_t n = 1 + random.below(3); n > 0; --n)
      text[random.below(text.size())] = static_cast<char>(random.below(256));
    refusals += refused(text) != "none";  // any other exception fails the test
  }
  EXPECT_GT(refusals, 2000);
}

TEST(Results, WhatIsNoDocument) {
  const std::string good = good_text();
  for (std::size_t cut = 0; cut + 3 < good.size(); cut += 97)
    EXPECT_NE(refused(good.substr(0, cut)), "none") << cut;
  EXPECT_NE(refused(good + "{}"), "none");
  EXPECT_NE(refused(std::string(200000, '[')), "none");
  EXPECT_NE(refused("[]"), "none");
  EXPECT_NE(refused("null"), "none");
  EXPECT_NE(refused("\xff\xfe"), "none");
  EXPECT_NE(refused(std::string(kMaxResultsBytes + 1, ' ')), "none");
  EXPECT_NE(refused(R"({"version":1,"version":1})"), "none");
}

}  // namespace texmesh::results_test
