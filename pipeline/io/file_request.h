#pragma once
#include <cstdint>
#include <string>

#include "format/base/sha256.h"
#include "pipeline/io/file_stamp.h"
#include "pipeline/io/record.h"

namespace texmesh {

/// A file that a model asked for. `digest`, `bytes` and `stamp` are zero unless found. Uri, found, digest and
/// bytes become part of the cache key: the same requests with the same answers give the same model.
struct FileRequest {
  std::string uri;  // as the model names it; "" = the model itself
  bool found = false;
  Sha256 digest{};
  std::uint64_t bytes = 0;
  FileStamp stamp;  // when it was read; no part of any key
  friend bool operator==(const FileRequest&, const FileRequest&) = default;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.uri, s.found, s.digest, s.bytes, s.stamp);
  }
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("uri", s.uri, kNamesFile, "");
    v("found", s.found, "");
    v("sha256", s.digest, "");
    v("bytes", s.bytes, "");
    v("stamp", s.stamp, kMayMiss, "");
  }
};

}  // namespace texmesh
