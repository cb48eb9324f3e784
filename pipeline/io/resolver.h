#pragma once
#include <map>
#include <optional>

#include "format/base/bytes.h"
#include "pipeline/io/uri.h"

namespace texmesh {

/// Gives import the files a model refers to, by names that are relative to the model's folder
/// (pipeline/import/named_files.h makes them of what stands in a model). What was asked for, found or not,
/// becomes part of the cache key.
class Resolver {
 public:
  virtual ~Resolver() = default;
  /// The bytes of a file, nothing when there is no such file. Throws FileRefused when the name is not allowed
  /// (absolute, drive letter, scheme, "..", a symbolic link that leads elsewhere, not a regular file), and
  /// InputError when the file exceeds max_bytes.
  virtual std::optional<Bytes> read(const std::string& uri, std::uint64_t max_bytes) = 0;
  /// textures/NAME beside the model's folder, where that may be read (FileResolver says when); `name` has one
  /// part. Nothing when there is none; throws as read().
  virtual std::optional<Bytes> read_beside(const std::string& /*name*/, std::uint64_t /*max_bytes*/) {
    return std::nullopt;
  }
  /// Files of other names that may be meant by `uri` (similar_key()), sorted.
  virtual std::vector<std::string> similar(const std::string&) { return {}; }
};

/// How requests have what read_beside() was asked for: "../textures/bust.png".
inline constexpr std::string_view kTexturesBeside = "../textures/";

/// What lies under a name must not be read.
struct FileRefused : InputError {
  using InputError::InputError;
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
  std::vector<std::string> similar(const std::string& uri) override {
    std::vector<std::string> names;
    for (const auto& [name, bytes] : files)
      if (name != uri && similar_key(name) == similar_key(uri)) names.push_back(name);
    return names;
  }
};

/// The machine, not the model: a file cannot be written (full disk, no permission) or cannot be read now (I/O
/// error, too many open files). Another moment or another place may do, so it is never remembered as a known
/// failure of the model.
struct ResourceError : InputError {
  using InputError::InputError;
};

/// What this user may not do here: no usage error (as_usage()). Another moment does not help, another user or
/// another place may.
struct PermissionError : ResourceError {
  using ResourceError::ResourceError;
};

}  // namespace texmesh
