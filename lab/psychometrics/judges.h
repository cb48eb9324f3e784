#pragma once
#include <cstdint>

namespace texmesh {

/// What a judge did, in numbers.
struct JudgeCounts {
  std::uint32_t answers = 0;  // all of them, catch trials included
  std::uint32_t left = 0;     // answers "left"
  std::uint32_t catches = 0;  // trials that everybody who looks answers rightly
  std::uint32_t caught = 0;   // of them answered rightly
};

enum class JudgeVerdict : std::uint8_t { kKept, kTooFew, kOneSide, kInattentive };

struct JudgeLimits {
  std::uint32_t least_answers = 20, least_catches = 4;
  double attentive_share = 0.9;  // of catch trials that a judge who looks answers rightly
  double inattentive_p = 0.05;   // least likelihood of so few right catch trials for such a judge
  double one_side_p = 1e-4;      // of so many answers on one side when sides are balanced
};

/// Whether a judge's answers count. kTooFew: fewer answers or catch trials than the limits; kOneSide: one
/// side so often that chance is no excuse; kInattentive: too few catch trials right. The first that holds.
JudgeVerdict screen_judge(const JudgeCounts& judge, const JudgeLimits& limits = {});

/// The chance of at most k of n, each with probability p: 0 < p < 1. 1 for k >= n.
double binomial_at_most(std::uint32_t k, std::uint32_t n, double p);

}  // namespace texmesh
