#pragma once
#include <map>
#include <optional>
#include <string>

#include "format/base/errors.h"
#include "pipeline/io/resolver.h"

namespace texmesh {

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

}  // namespace texmesh
