#pragma once
#include <cstdint>
#include <optional>
#include <string>

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

}  // namespace texmesh
