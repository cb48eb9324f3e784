#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace texmesh {

struct CompileOptions;

/// One model of a collection.
struct CollectionModel {
  std::string input;   // path; relative ones are relative to the collection's folder
  std::string output;  // path beneath the output folder, ends with ".texmesh"
  // Defaults, then the collection's options, then those of the patterns that match, in their order, then the
  // model's own. What `about` says of each of them goes the same way, field by field, into package.meta.
  // Models with equal options share them.
  std::shared_ptr<const CompileOptions> options;
  bool unread = false;  // a folder's .json, as in ModelPath; its output may be another's
};

/// Finds the models of a folder that a collection names, as list_models(): paths relative to the folder,
/// sorted. The reader itself looks at no folder.
using FolderLister = std::function<std::vector<std::string>(const std::string& folder)>;

/// Reads a collection (schemas/collection.v1.schema.json): models, folders of models, and their options.
/// Strict: unknown fields, wrong types, options out of range, outputs that leave the output folder and
/// outputs named twice throw InputError{file_name, JSON pointer, ...}. `base` holds the options that the
/// collection starts from (a profile). A model that is listed and found in a folder, too, is compiled
/// once, as listed. Patterns are matched against the input as the collection writes it; `*` and `?` match
/// "/" as well.
std::vector<CollectionModel> read_collection(const std::string& json, const std::string& file_name,
                                             const CompileOptions& base,
                                             const FolderLister& list_folder = {});

}  // namespace texmesh
