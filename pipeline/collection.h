#pragma once
#include <string>
#include <vector>

#include "pipeline/options.h"

namespace texmesh {

/// One model of a collection.
struct CollectionModel {
  std::string input;       // path, relative to the collection's file
  std::string output;      // path beneath the output folder, ends with ".texmesh"
  CompileOptions options;  // defaults, then the collection's options, then the model's
};

/// Reads a collection (schemas/collection.v1.schema.json): many models with their options. Strict: unknown
/// fields, wrong types, options out of range, outputs that leave the output folder and outputs named twice
/// throw InputError{file_name, JSON pointer, ...}. `base` holds the options that the collection starts from
/// (a profile, the command line).
std::vector<CollectionModel> read_collection(const std::string& json, const std::string& file_name,
                                             const CompileOptions& base);

}  // namespace texmesh
