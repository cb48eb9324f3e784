#pragma once
// The test vectors in delivery/vectors say what every client decides (delivery/vectors/README.md). They are
// written by this program and compared with what it would write today; the TypeScript client runs the same
// files.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "delivery/cpp/decide/harmonic_time.h"
#include "format/rules/viewing.h"

namespace texmesh {

using Json = nlohmann::ordered_json;
inline const std::string kRoot = TEXMESH_SOURCE_DIR;

// ---- names of options, as in the files

inline const std::map<Policy, const char*> kPolicies{
    {Policy::kHtc, "htc"},       {Policy::kGuard, "guard"},
    {Policy::kPrice, "price"},   {Policy::kProportional, "proportional"},
    {Policy::kStatic, "static"}, {Policy::kThesis, "thesis"}};
inline const std::map<HtcOrder, const char*> kOrders{
    {HtcOrder::kCredit, "credit"}, {HtcOrder::kBeta0, "beta0"}, {HtcOrder::kFinest, "finest"}};
inline const std::map<Estimator, const char*> kEstimators{
    {Estimator::kLast, "last"}, {Estimator::kHarmonic, "harmonic"}, {Estimator::kEwma, "ewma"}};
inline const std::map<StepRule, const char*> kRules{{StepRule::kFlip, "flip"},
                                                    {StepRule::kJnd, "jnd"},
                                                    {StepRule::kError, "error"},
                                                    {StepRule::kEdge, "edge"}};

inline Json options_json(const ThroughputOptions& o) {
  return {{"estimator", kEstimators.at(o.estimator)},
          {"samples", o.samples},
          {"ewma", o.ewma},
          {"small_bytes", o.small_bytes},
          {"initial_bytes_s", o.initial_bytes_s}};
}
inline Json options_json(const HtcOptions& o) {
  return {{"policy", kPolicies.at(o.policy)},
          {"order", kOrders.at(o.order)},
          {"time_limit_s", o.time_limit_s},
          {"throughput", options_json(o.throughput)},
          {"rtt_s", o.rtt_s},
          {"window", o.window},
          {"max_in_flight", o.max_in_flight},
          {"hard_limits", o.hard_limits},
          {"guard", o.guard},
          {"price_kappa", o.price_kappa}};
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

inline void expect_file(const char* name, const char* what, const Json& cases) {
  const std::string path = kRoot + "/delivery/vectors/" + name, text = text_of(what, cases);
  ASSERT_GT(cases.size(), 0u);
  if (std::getenv("TEXMESH_WRITE_VECTORS")) {
    std::ofstream(path, std::ios::binary) << text;
    return;
  }
  std::ifstream in(path, std::ios::binary);
  std::ostringstream there;
  there << in.rdbuf();
  // Not EXPECT_EQ: a megabyte of text helps nobody.
  EXPECT_TRUE(there.str() == text) << path << " differs from what the library decides today; "
                                   << "TEXMESH_WRITE_VECTORS=1 writes it anew";
}

}  // namespace texmesh
