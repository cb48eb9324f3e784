#pragma once

#include "format/base/note.h"

namespace texmesh {

struct ScaleFile {
  int scale = 0;                              // scale number
  std::vector<std::uint8_t> glb;              // glTF 2.0 binary; empty: the stream alone has the scale
  std::uint32_t triangles = 0, vertices = 0;  // as stored: a vertex is a wedge
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.scale, s.glb, s.triangles, s.vertices);
  }
};

struct ScaleFiles {
  std::vector<ScaleFile> files;        // the kept scales, S_0 first
  int position_bits = 0, uv_bits = 0;  // as used; 0 = float
  double position_error = 0;           // the largest rounding of a coordinate, object units
  std::vector<std::uint8_t> stream;    // mesh/stream.bin; empty when there is none
  Notes notes;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.files, s.position_bits, s.uv_bits, s.position_error, s.stream, s.notes);
  }
};

}  // namespace texmesh
