#include "pipeline/batch/plan.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "format/base/errors.h"
#include "pipeline/batch/collection.h"
#include "pipeline/batch/find_models.h"
#include "pipeline/batch/repeated_texts.h"
#include "pipeline/compile/options.h"
#include "pipeline/compile/profile.h"
#include "pipeline/io/file_resolver.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kMaxCollectionBytes = 256u << 20;

bool is_collection(const std::string& input) {
  return fs::path(input).extension() == ".json" && fs::is_regular_file(input) && !is_range_scan(input);
}

/// Resolved options after the command line's flags, as text; one text for all models that share an object.
class Profiles {
 public:
  explicit Profiles(const PlanRequest& request) : request_(request) {}
  std::shared_ptr<const std::string> of(const std::shared_ptr<const CompileOptions>& options) {
    auto& text = by_options_[options.get()];
    if (!text) {
      CompileOptions all = *options;
      if (request_.apply_flags) request_.apply_flags(all);
      std::string profile = write_profile(resolve_options(std::move(all)));
      text = by_text_.try_emplace(profile, std::make_shared<const std::string>(profile)).first->second;
      kept_.push_back(options);  // so that no other object gets its address
    }
    return text;
  }

 private:
  const PlanRequest& request_;
  std::map<const CompileOptions*, std::shared_ptr<const std::string>> by_options_;
  std::map<std::string, std::shared_ptr<const std::string>> by_text_;
  std::vector<std::shared_ptr<const CompileOptions>> kept_;
};

void add_collection(const std::string& file, const PlanRequest& request, const CompileOptions& base,
                    Profiles& profiles, BatchPlan& plan) {
  const auto bytes = read_input_file(file, kMaxCollectionBytes);
  const fs::path folder = fs::path(file).parent_path();
  const auto list = [&](const std::string& name) { return list_models((folder / name).string()); };
  for (const CollectionModel& m :
       read_collection(std::string(bytes.begin(), bytes.end()), file, base, list)) {
    const std::string input = (folder / m.input).string();
    plan.models.push_back(
        {input, (fs::path(request.output) / m.output).string(), false, m.unread, profiles.of(m.options)});
  }
  plan.files.push_back(file);
}

/// Unread files that `chosen` names leave the plan where they are no models.
template <class Chosen>
void read_unread(BatchPlan& plan, const Chosen& chosen) {
  for (PlannedModel& m : plan.models) {
    if (!m.unread || !chosen(m)) continue;
    m.unread = false;
    if (!is_range_scan(m.input)) m.input.clear();
  }
  std::erase_if(plan.models, [](const PlannedModel& m) { return m.input.empty(); });
}

void refuse_shared_outputs(BatchPlan& plan) {
  const auto output_of = [](const PlannedModel& m) { return std::string_view(m.output); };
  const auto shared = repeated_texts(plan.models, output_of);
  if (shared.empty()) return;
  // The few that must be opened by every shard, such as a meta.json in each of two folders.
  read_unread(plan, [&](const PlannedModel& m) { return shared.contains(m.output); });
  if (const auto [m, other] = first_repetition(plan.models, output_of); m)
    throw InputError(m->input, "", "a package of its own", m->output + ", which is that of " + other->input);
}

/// Costs are whole microseconds: sums of them do not depend on their order.
std::uint64_t cost_us(const PlannedModel& m, const std::string& package, const PlanRequest& request) {
  const auto known = request.costs_s.find(package);
  if (known != request.costs_s.end()) return static_cast<std::uint64_t>(known->second * 1e6);
  std::error_code ec;
  const auto bytes = fs::file_size(m.input, ec);
  return static_cast<std::uint64_t>(guessed_seconds(ec ? 0 : bytes) * 1e6);
}

void drop_other_shards(BatchPlan& plan, const PlanRequest& request) {
  const ShardSplit split = split_plan(plan, request, request.shard.count);
  plan.collection = split.collection;
  std::size_t i = 0;
  std::erase_if(plan.models, [&](const PlannedModel&) { return split.shard_of[i++] != request.shard.index; });
}

}  // namespace

BatchPlan plan_batch(const PlanRequest& request) {
  BatchPlan plan = plan_collection(request);
  const std::size_t in_collection = plan.models.size();
  plan.shard = request.shard;
  if (request.shard.count > 1) drop_other_shards(plan, request);
  read_unread(plan, [](const PlannedModel&) { return true; });
  plan.models_in_collection = request.shard.count > 1 ? in_collection : plan.models.size();
  return plan;
}

BatchPlan plan_collection(const PlanRequest& request) {
  BatchPlan plan;
  const auto base = request.base ? request.base : std::make_shared<const CompileOptions>();
  Profiles profiles(request);
  std::vector<std::string> others;
  for (const std::string& input : request.inputs)
    if (is_collection(input))
      add_collection(input, request, *base, profiles, plan);
    else
      others.push_back(input);
  const bool names_package =
      fs::path(request.output).extension() == ".texmesh" && !fs::is_directory(request.output);
  if (!plan.files.empty() && names_package)
    throw InputError(request.output, "", "a folder for the packages of a collection",
                     "the name of one package");
  if (!others.empty()) {
    std::vector<ModelPath> found = find_models(others, request.output);
    plan.models.reserve(plan.models.size() + found.size());
    const bool alone = request.inputs.size() == 1 && names_package;
    for (ModelPath& m : found)
      plan.models.push_back({std::move(m.input), std::move(m.output), alone, m.unread, profiles.of(base)});
  }
  refuse_shared_outputs(plan);
  plan.output_prefix = (fs::path(request.output) / "").string();
  plan.outputs = fs::absolute(request.output).lexically_normal().string();
  return plan;
}

std::string package_within(const BatchPlan& plan, const PlannedModel& m) {
  if (m.output.starts_with(plan.output_prefix)) return m.output.substr(plan.output_prefix.size());
  return fs::path(m.output).filename().string();
}

ShardSplit split_plan(const BatchPlan& plan, const PlanRequest& request, int shards) {
  ShardSplit split;
  std::vector<ModelCost> costs;
  split.packages.reserve(plan.models.size());  // the costs point into it
  for (const PlannedModel& m : plan.models) {
    split.packages.push_back(package_within(plan, m));
    costs.push_back({split.packages.back(), cost_us(m, split.packages.back(), request)});
  }
  split.collection = collection_digest(costs);
  split.shard_of = balance_shards(costs, shards);
  return split;
}

}  // namespace texmesh
