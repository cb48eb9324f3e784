#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "delivery/cpp/package/http_link.h"
#include "format/base/bytes.h"

namespace texmesh {

/// Whole files of a tree, from any of its servers.
class HttpTree {
 public:
  HttpTree(std::string root, std::shared_ptr<HttpLink> link, bool ranges)
      : root_(std::move(root)), link_(std::move(link)), ranges_(ranges) {}
  const std::string& root() const { return root_; }
  std::string name() const { return shown_url(root_); }
  void store(const std::string& path, Bytes bytes) { files_[path] = std::move(bytes); }

  struct Wanted {
    std::string path;
    std::uint64_t max_bytes = 0;
    Bytes got = {};  // of a transfer that broke, where the server knows ranges
    std::string etag = {};
  };
  /// Fetches the file unless it is here.
  const Bytes& file(const std::string& path, std::uint64_t max_bytes) {
    fetch({{path, max_bytes}});
    return files_[path];
  }
  /// Fetches all of these at once but those that are here.
  void fetch(std::vector<Wanted> wanted);

 private:
  void start(std::size_t number, const Wanted& w);
  /// Whether the file is complete now.
  bool accept(Wanted& w, HttpAnswer& a) const;
  std::string root_;
  std::shared_ptr<HttpLink> link_;
  bool ranges_;
  std::map<std::string, Bytes> files_;
};

}  // namespace texmesh
