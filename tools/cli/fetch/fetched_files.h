#pragma once
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "delivery/cpp/client/texture_loader.h"
#include "format/base/bytes.h"

namespace texmesh {

/// What `fetch` writes into its folder: files as `unpack --fragments files` names them, of each fragment the
/// best rung. Without a folder nothing is written.
class FetchedFiles {
 public:
  FetchedFiles(PackageReader& package, const std::string& folder) : package_(package), folder_(folder) {}
  /// Keeps a fragment for write().
  void add(const LoadedFragment& fragment);
  /// Writes the fragments.
  void write();
  /// Writes an entry at once.
  void write_entry(const std::string& path, const Bytes& bytes);

 private:
  PackageReader& package_;
  std::string folder_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<Bytes>> streams_;  // by plane and fragment
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::int32_t> rungs_;
};

}  // namespace texmesh
