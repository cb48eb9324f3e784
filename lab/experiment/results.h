#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace texmesh {

inline constexpr std::uint64_t kMaxResultsBytes = 2u << 20;

/// One choice of a judge.
struct ExperimentAnswer {
  std::uint32_t trial = 0;  // of the design
  double displayed_px = 0, level = 0;
  bool is_catch = false;
  bool same_on_right = false, chose_right = false;
  double seconds = 0;
  bool late = false;  // after the time limit
  bool right() const { return same_on_right == chose_right; }
  friend bool operator==(const ExperimentAnswer&, const ExperimentAnswer&) = default;
};

/// What the page has kept of one judge: schemas/experiment-results.v1.schema.json.
struct ExperimentResults {
  std::string file;    // for reports
  std::string design;  // its id
  std::string kind, judge;
  std::uint32_t trials = 0;  // of the whole experiment
  std::vector<ExperimentAnswer> answers;
};

/// Strict: a field that is missing or unknown, a wrong type, a number out of range, and a trial answered
/// twice or beyond the experiment are an InputError {file, JSON pointer, ...}.
ExperimentResults read_results(std::span<const std::uint8_t> json, const std::string& file);

}  // namespace texmesh
