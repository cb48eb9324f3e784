#pragma once
#include "format/base/bytes.h"

namespace texmesh {

/// What a client shows of a whole texture before any fragment is there.
struct PlanePreview {
  Bytes file;  // a complete JPEG; empty for mips, whose full-size plane's preview serves
  std::uint32_t width_px = 0, height_px = 0;
  static void archive(auto& s, auto& a) { a(s.file, s.width_px, s.height_px); }
};

struct Previews {
  std::vector<PlanePreview> planes;  // as Fragments::planes
  static void archive(auto& s, auto& a) { a(s.planes); }
};

/// One picture of the whole object, for lists and search engines.
struct Poster {
  Bytes file;  // a baseline JPEG, sRGB; empty = the package has no poster
  std::uint32_t width_px = 0, height_px = 0;
  static void archive(auto& s, auto& a) { a(s.file, s.width_px, s.height_px); }
};

}  // namespace texmesh
