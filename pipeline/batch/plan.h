#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace texmesh {

struct CompileOptions;

/// One model of a run.
struct PlannedModel {
  std::string input, output;                   // paths as this process can open them
  std::string name;                            // as messages and reports call it
  std::shared_ptr<const std::string> profile;  // JSON of every option; models with equal options share it
};

struct PlanRequest {
  std::vector<std::string> inputs;                   // models, folders, collections
  std::string output;                                // package or folder
  std::shared_ptr<const CompileOptions> base;        // of the profile, not resolved; null = defaults
  std::function<void(CompileOptions&)> apply_flags;  // the command line's options, which win over everything
  // This run's part: models whose package's name falls on `shard` of 0 .. shards - 1.
  int shard = 0, shards = 1;
};

struct BatchPlan {
  std::vector<PlannedModel> models;
  std::vector<std::string> files;  // collections that were read: a make-style rule depends on them
  std::string outputs;  // absolute path of the output folder, or of the package where there can be one only
  std::string output_prefix;  // what the models' outputs begin with: the output folder and a slash
};

/// Finds the models and their options. A model's shard depends on its package's path within the output
/// folder alone, so that it stays when models come and go. InputError for what makes no sense, before
/// anything is compiled.
BatchPlan plan_batch(const PlanRequest& request);

/// The path of a model's package within the output folder; its name where the run makes one package only.
std::string package_within(const BatchPlan& plan, const PlannedModel& model);

}  // namespace texmesh
