#pragma once

#include "format/base/bytes.h"

namespace texmesh {

/// One picture of the whole object, for lists and search engines.
struct Poster {
  Bytes file;  // a baseline JPEG, sRGB; empty = the package has no poster
  std::uint32_t width_px = 0, height_px = 0;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.file, s.width_px, s.height_px);
  }
};

}  // namespace texmesh
