#pragma once
// Models and options for tests of the machinery around the stages, where their work is only in the way.
#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/command.h"

namespace texmesh::testing {

/// The cheapest options, as a profile.
inline constexpr const char* kCheapProfile = R"({"version":1,
  "skeletonization":{"alpha_divisor":5,"offset_divisor":50,"max_wrap_faces":100},"ssf":{"scales":2},
  "quality":{"views":1,"largest_px":128,"rung_samples":1},"ladder":{"rungs":[30]},
  "perceptual_values":{"samples":100},"scales":{"stream":false}})";

/// Long sweeps were asked for.
inline bool full_sweeps() { return std::getenv("TEXMESH_FULL") != nullptr; }

using Packages = std::map<std::string, std::string>;  // path beneath the output folder -> bytes

inline Packages packages_in(const std::string& folder) {
  Packages all;
  for (const std::string& f : files_beneath(folder))
    all[f] = read_text((std::filesystem::path(folder) / f).string());
  return all;
}

/// `count` different tiny models in `folder`: scan_00000.glb and so on.
inline void make_tiny_models(const std::string& make_scan, int count, const std::string& folder) {
  const CommandResult made = run_command(
      {make_scan, "--many", std::to_string(count), "--triangles", "48", "--texture", "16", "-o", folder});
  ASSERT_EQ(made.exit_code, 0) << made.errors;
}

/// The lines of `texmesh compile --json`.
inline std::vector<nlohmann::json> events_of(const std::string& output) {
  std::vector<nlohmann::json> events;
  std::istringstream in(output);
  for (std::string line; std::getline(in, line);) events.push_back(nlohmann::json::parse(line));
  return events;
}

}  // namespace texmesh::testing
