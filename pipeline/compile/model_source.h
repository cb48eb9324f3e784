#pragma once
#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/compile/artefacts.h"
#include "pipeline/compile/compile_model.h"
#include "pipeline/graph/store.h"

namespace texmesh {

/// What compiling so many triangles takes at least, without their textures.
std::uint64_t least_memory_bytes(std::uint64_t triangles);

/// The model file with the files it refers to. Which those are is known only after an import, so the store
/// remembers the list of the last one (as ccache's manifest does): while every file on it reads as it did,
/// import need not run.
class ModelSource {
 public:
  explicit ModelSource(const CompileRequest& request);

  /// Reads what is needed to know parts(). Before anything else. `may_write_notes`: the store may be told the
  /// list. InputError, ResourceError, Cancelled.
  void open(Store& store, const RunContext& context, bool may_write_notes);

  /// What the model is made of: its own bytes, and every file that it asked for, found or not.
  std::vector<std::pair<std::string, std::string>> parts() const;
  Sha256 digest() const { return digest_of_parts(parts()); }

  /// Imports the model, unless open() has. InputError when a file is not what it was at open(). Refers to
  /// this object.
  Source source();

  /// Input digests for provenance: the model's own references, never the paths of this machine.
  nlohmann::ordered_json inputs() const;

  /// The model, then what it asked for, in that order.
  std::vector<FileRequest> files() const;

 private:
  void look_at_model();
  void forget_bytes();
  void read_model();
  Sha256 list_key() const;
  bool unchanged_since(const std::string& note);
  ImportedModel import(const ImportOptions& options, const RunContext& context,
                       std::vector<FileRequest>& requests);

  std::filesystem::path path_;
  ImportOptions options_;  // of open()
  std::uint64_t memory_bytes_ = 0;
  std::vector<FileRequest> known_;
  Bytes bytes_;
  bool has_bytes_ = false;
  FileRequest main_;
  std::vector<FileRequest> requests_;
  std::shared_ptr<ImportedModel> imported_;
};

}  // namespace texmesh
