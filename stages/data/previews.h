#pragma once

#include "format/base/bytes.h"

namespace texmesh {

/// What a client shows of a whole texture before any fragment is there.
struct PlanePreview {
  Bytes file;  // a complete JPEG; empty for mips, whose full-size plane's preview serves
  std::uint32_t width_px = 0, height_px = 0;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.file, s.width_px, s.height_px);
  }
};

struct Previews {
  std::vector<PlanePreview> planes;  // as Fragments::planes
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.planes);
  }
};

}  // namespace texmesh
