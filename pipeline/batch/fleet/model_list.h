#pragma once

#include "pipeline/batch/plan.h"
#include "pipeline/io/record.h"

namespace texmesh {

/// A model of a collection as other engines need it.
struct ListedModel {
  std::string input, output, package;  // package: the output's path within the output folder
  std::vector<std::string> files;      // beside the model, see named_files()
  std::uint64_t bytes = 0;             // of the model and these files
  int shard = 0;
  static void fields(auto& s, auto&& v) {
    v("model", s.input, "");
    v("output", s.output, "");
    v("package", s.package, "path of the output within the output folder");
    v("files", s.files, "further files that the model names and that are there");
    v("bytes", s.bytes, "of the model and these files");
    v("shard", s.shard, Range{0, 999'999}, "");
  }
};

struct ModelList {
  std::vector<ListedModel> models;
  int shards = 1;
  std::string collection;                // collection_digest() where there are several shards
  std::vector<std::string> collections;  // files that were read to find the models
  std::vector<std::string> stale;        // BatchPlan::stale
  static void fields(auto& s, auto&& v) {
    v("version", Constant{1}, "");
    v("shards", s.shards, Range{1, 1'000'000}, "");
    v("collection", s.collection, FieldRule{.pattern = "^[0-9a-f]{64}$", .may_miss = true},
      "where there are several shards: as in the shards' summaries");
    v("collections", s.collections, "collection files that were read, and the files of notes that they name");
    v("stale", s.stale, kMayMiss, "packages in the output folder that no model makes: paths within it");
    v("models", s.models, "");
  }
};

/// Every model of a plan of the whole collection, with the shard that `compile --shard I/shards` gives it.
ModelList list_collection(const PlanRequest& request, int shards);

/// schemas/list.v1.schema.json
std::string write_model_list(const ModelList& list);
/// list.v1.
DocumentSchema list_schema();

/// The files beside a model that the model names, sorted, paths that begin with the model's folder: buffers
/// and images of glTF, libraries of OBJ and their textures, textures of PLY, the grid and texture of a range
/// scan. Only what is there. No picture is opened and no mesh read: of OBJ the first MiB is looked through,
/// of the others the part that holds names. A file that is not as it should be names nothing; compiling says
/// why.
std::vector<std::string> named_files(const std::string& model, const std::vector<std::string>& links_within);

}  // namespace texmesh
