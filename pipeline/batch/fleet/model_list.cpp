#include "pipeline/batch/fleet/model_list.h"

#include <filesystem>

#include "pipeline/batch/find_models.h"
#include "pipeline/batch/fleet/json_lines.h"
#include "pipeline/batch/fleet/named_files.h"

namespace texmesh {
namespace {

std::uint64_t bytes_of_file(const std::string& path) {
  std::error_code ec;
  const auto bytes = std::filesystem::file_size(path, ec);
  return ec ? 0 : bytes;
}

}  // namespace

ModelList list_collection(const PlanRequest& request, int shards) {
  const BatchPlan plan = plan_collection(request);
  ModelList list;
  list.shards = shards;
  list.collections = plan.files;
  const ShardSplit split = split_plan(plan, request, shards);
  list.collection = shards > 1 ? split.collection : "";
  for (std::size_t i = 0; i < plan.models.size(); ++i) {
    const PlannedModel& m = plan.models[i];
    if (m.unread && !is_range_scan(m.input)) continue;
    ListedModel listed{
        m.input,          m.output, split.packages[i], named_files(m.input), bytes_of_file(m.input),
        split.shard_of[i]};
    for (const std::string& file : listed.files) listed.bytes += bytes_of_file(file);
    list.models.push_back(std::move(listed));
  }
  return list;
}

std::string write_model_list(const ModelList& list) {
  using ListJson = nlohmann::ordered_json;
  ListJson head{{"version", 1}, {"shards", list.shards}};
  if (!list.collection.empty()) head["collection"] = list.collection;
  head["collections"] = list.collections;
  return json_with_lines(head, "models", list.models, [](const ListedModel& m) {
    return ListJson{{"model", m.input}, {"output", m.output}, {"package", m.package},
                    {"files", m.files}, {"bytes", m.bytes},   {"shard", m.shard}};
  });
}

}  // namespace texmesh
