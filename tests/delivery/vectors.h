#pragma once
// The test vectors in delivery/vectors say what every client decides (delivery/vectors/README.md). They are
// written by this program and compared with what it would write today; the TypeScript client runs the same
// files.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "delivery/cpp/decide/harmonic_time.h"
#include "format/rules/viewing.h"

namespace texmesh {

using Json = nlohmann::ordered_json;
inline const std::string kRoot = TEXMESH_SOURCE_DIR;

// ---- options, by their names in the files

/// How a case is decided.
struct VectorOptions {
  std::string policy, order = "credit", estimator = "last";
  int samples = 10;
  HtcOptions htc = {};
};
/// Sets the policy; false: not known here, the case is left out. What the product does not know, tests/lab
/// does.
using KnowsPolicy = std::function<bool(VectorOptions& options)>;

inline const std::vector<std::string> kPolicies{"htc", "guard", "price", "proportional", "static", "thesis"};
inline const std::map<StepRule, const char*> kRules{{StepRule::kFlip, "flip"},
                                                    {StepRule::kJnd, "jnd"},
                                                    {StepRule::kError, "error"},
                                                    {StepRule::kEdge, "edge"},
                                                    {StepRule::kDistance, "distance"}};

inline Json throughput_json(const std::string& estimator, int samples, double initial_bytes_s) {
  return {{"estimator", estimator},
          {"samples", samples},
          {"ewma", 0.2},
          {"small_bytes", 4000.0},
          {"initial_bytes_s", initial_bytes_s}};
}
inline Json options_json(const VectorOptions& o) {
  return {{"policy", o.policy},
          {"order", o.order},
          {"time_limit_s", o.htc.time_limit_s},
          {"throughput", throughput_json(o.estimator, o.samples, o.htc.initial_bytes_s)},
          {"rtt_s", o.htc.rtt_s},
          {"window", o.htc.window},
          {"max_in_flight", 64},
          {"hard_limits", o.htc.hard_limits},
          {"guard", 1.5},
          {"price_kappa", 10.0}};
}
inline Json offer_json(const FragmentOffer& f) {
  return {{"bytes", f.bytes},       {"loss", f.loss},
          {"eta", f.eta},           {"planned_bytes", f.planned_bytes},
          {"low_rung", f.low_rung}, {"high_rung", f.high_rung}};
}
inline Json offers_json(const std::vector<FragmentOffer>& offers) {
  Json out = Json::array();
  for (const FragmentOffer& f : offers) out.push_back(offer_json(f));
  return out;
}

// ---- the files

/// One case a line: a change of a decision shows as a change of its line.
inline std::string text_of(const char* what, const Json& cases) {
  std::string out = std::string("{\"what\": ") + Json(what).dump() + ",\n \"cases\": [\n";
  for (std::size_t i = 0; i < cases.size(); ++i)
    out += "  " + cases[i].dump() + (i + 1 < cases.size() ? ",\n" : "\n");
  return out + "]}\n";
}

inline std::string path_of(const char* name) { return kRoot + "/delivery/vectors/" + name; }
inline std::string read_vectors(const char* name) {
  std::ifstream in(path_of(name), std::ios::binary);
  std::ostringstream there;
  there << in.rdbuf();
  return there.str();
}

inline void expect_file(const char* name, const char* what, const Json& cases) {
  const std::string text = text_of(what, cases);
  ASSERT_GT(cases.size(), 0u);
  if (std::getenv("TEXMESH_WRITE_VECTORS")) {
    std::ofstream(path_of(name), std::ios::binary) << text;
    return;
  }
  // Not EXPECT_EQ: a megabyte of text helps nobody.
  EXPECT_TRUE(read_vectors(name) == text) << path_of(name) << " differs from what the library decides today; "
                                          << "TEXMESH_WRITE_VECTORS=1 writes it anew";
}

/// The cases that stand in the file, without what `reduce` takes out or (false) leaves out.
inline void expect_cases(const char* name, const Json& cases, const std::function<bool(Json& c)>& reduce) {
  Json known = Json::array();
  Json file = Json::parse(read_vectors(name));
  for (Json& c : file["cases"])
    if (reduce(c)) known.push_back(std::move(c));
  ASSERT_EQ(known.size(), cases.size());
  for (std::size_t i = 0; i < cases.size(); ++i)
    EXPECT_TRUE(known[i].dump() == cases[i].dump()) << path_of(name) << ": " << known[i]["name"];
}

}  // namespace texmesh
