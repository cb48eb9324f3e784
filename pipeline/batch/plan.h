#pragma once
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/batch/fleet/shards.h"

namespace texmesh {

struct CompileOptions;

/// One model of a run.
struct PlannedModel {
  std::string input, output;                   // paths as this process can open them
  bool alone = false;                          // the one model of a package that the command line names
  bool unread = false;                         // as in ModelPath
  std::shared_ptr<const std::string> profile;  // JSON of every option; models with equal options share it
  /// As messages and reports call it.
  std::string_view name() const { return std::string_view(input).substr(alone ? input.rfind('/') + 1 : 0); }
};

struct PlanRequest {
  std::vector<std::string> inputs;                   // models, folders, collections
  std::string output;                                // package or folder
  std::shared_ptr<const CompileOptions> base;        // of the profile, not resolved; null = defaults
  std::function<void(CompileOptions&)> apply_flags;  // the command line's options, which win over everything
  Shard shard;                                       // this run's part
  std::map<std::string, double> costs_s;  // by package within the output folder: what models took before
};

struct BatchPlan {
  std::vector<PlannedModel> models;
  std::vector<std::string> files;  // collections that were read: a make-style rule depends on them
  std::string outputs;  // absolute path of the output folder, or of the package where there can be one only
  std::string output_prefix;  // what the models' outputs begin with: the output folder and a slash
  Shard shard;
  std::size_t models_in_collection = 0;  // of all shards: their unread ones count
  std::string collection;                // collection_digest() where there are several shards, else ""
};

/// Finds the models and their options. Several shards are balanced by `costs_s`, and by the sizes of the
/// models' files where a model is not among them: runs that see the same files and costs split the models
/// alike, and open only their own. InputError for what makes no sense, before anything is compiled.
BatchPlan plan_batch(const PlanRequest& request);

/// The same before it is split on shards: what names alone tell, unread files with it.
BatchPlan plan_collection(const PlanRequest& request);

/// The path of a model's package within the output folder; its name where the run makes one package only.
std::string package_within(const BatchPlan& plan, const PlannedModel& model);

/// How the models of a plan_collection() fall on shards.
struct ShardSplit {
  std::vector<std::string> packages;  // of each model: its package's path within the output folder
  std::vector<int> shard_of;
  std::string collection;  // collection_digest()
};
ShardSplit split_plan(const BatchPlan& plan, const PlanRequest& request, int shards);

}  // namespace texmesh
