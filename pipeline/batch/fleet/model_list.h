#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "pipeline/batch/plan.h"

namespace texmesh {

/// A model of a collection as other engines need it.
struct ListedModel {
  std::string input, output, package;  // package: the output's path within the output folder
  std::vector<std::string> files;      // beside the model, see named_files()
  std::uint64_t bytes = 0;             // of the model and these files
  int shard = 0;
};

struct ModelList {
  std::vector<ListedModel> models;
  int shards = 1;
  std::string collection;                // collection_digest() where there are several shards
  std::vector<std::string> collections;  // files that were read to find the models
};

/// Every model of a plan of the whole collection, with the shard that `compile --shard I/shards` gives it.
ModelList list_collection(const PlanRequest& request, int shards);

/// schemas/list.v1.schema.json
std::string write_model_list(const ModelList& list);

}  // namespace texmesh
