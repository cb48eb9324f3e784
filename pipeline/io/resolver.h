#pragma once
#include <map>
#include <optional>

#include "format/base/bytes.h"

namespace texmesh {

/// Gives import the files a model refers to. The pipeline's resolver opens beneath the model's folder only;
/// tests use memory. What was asked for, found or not, becomes part of the cache key.
class Resolver {
 public:
  virtual ~Resolver() = default;
  /// The bytes of `uri` (relative, already percent-decoded where the format says so), nothing when there is
  /// no such file. Throws InputError when the name is not allowed (absolute, drive letter, scheme, "..",
  /// symbolic link, not a regular file) or the file exceeds max_bytes.
  virtual std::optional<Bytes> read(const std::string& uri, std::uint64_t max_bytes) = 0;
};

/// Files that were made in memory, by their names.
class MemoryFiles : public Resolver {
 public:
  std::map<std::string, Bytes> files;
  std::optional<Bytes> read(const std::string& uri, std::uint64_t max_bytes) override {
    const auto it = files.find(uri);
    if (it == files.end()) return std::nullopt;
    if (it->second.size() > max_bytes)
      throw InputError(uri, "", "at most " + std::to_string(max_bytes) + " bytes", "more");
    return it->second;
  }
};

/// The machine, not the model: a file cannot be written (full disk, no permission) or cannot be read now (I/O
/// error, too many open files). Another moment or another place may do, so it is never remembered as a known
/// failure of the model.
struct ResourceError : InputError {
  using InputError::InputError;
};

}  // namespace texmesh
