#pragma once
#include "format/base/bytes.h"
#include "format/base/note.h"

namespace texmesh {

/// Files for viewers that know glTF and nothing of packages: entries of the package, by their paths.
struct GltfScales {
  struct File {
    std::string path;
    Bytes bytes;
    static void archive(auto& s, auto& a) { a(s.path, s.bytes); }
  };
  std::vector<File> files;
  Notes notes;
  static void archive(auto& s, auto& a) { a(s.files, s.notes); }
};

}  // namespace texmesh
