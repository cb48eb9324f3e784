#pragma once
#include "stages/data/stage.h"

namespace texmesh {

enum class MeshCodec : std::uint8_t { kDraco, kMeshopt, kQuantized, kNone };
template <>
struct EnumNames<MeshCodec> {
  static constexpr std::array<std::string_view, 4> names{"draco", "meshopt", "quantized", "none"};
};

/// Which scales are GLBs: those of the step function, both ends, or all that are kept. The ends always are.
enum class ScaleGlbs : std::uint8_t { kSteps, kEnds, kAll };
template <>
struct EnumNames<ScaleGlbs> {
  static constexpr std::array<std::string_view, 3> names{"steps", "ends", "all"};
};

struct ScalesOptions {
  MeshCodec mesh_codec = MeshCodec::kDraco;
  static constexpr int draco_level = 7;  // compression level
  // At most 24 (a float's mantissa; Draco takes minutes beyond) and 16 for the codecs on unsigned shorts;
  // where 0 would need more, coordinates stay floats.
  int position_bits = 0;  // 0 = error <= 1/16 of the mean and 1/4 of the 5th percentile of S_0's edges
  int uv_bits = 0;        // 0 = error <= 1/8 texel of the largest texture
  // Where 0: at least so many. A lit picture of a saxophone, 512 px high, tells 14 bits of positions from
  // floats by a FLIP of .006, 16 by .003; 14 bits of texture coordinates by .003; normals of 10 bits by .003,
  // of 11 by .002.
  int least_position_bits = 16;
  int least_uv_bits = 14;
  int normal_bits = 11;
  int tangent_bits = 8;
  bool stream = true;  // the vertex-split stream beside the files
  ScaleGlbs glb = ScaleGlbs::kSteps;
  static void fields(auto& s, auto&& v) {
    v("mesh_codec", s.mesh_codec, "how the scales' GLB files store their meshes");
    v("position_bits", s.position_bits, Range{0, 24},
      "bits per position coordinate, at least 6; 0 = from the edge lengths; quantized and meshopt: at "
      "most 16");
    v("uv_bits", s.uv_bits, Range{0, 24},
      "bits per texture coordinate; 0 = so that the error is under 1/8 texel; quantized and meshopt: 16 "
      "where that is so fine, or floats");
    v("least_position_bits", s.least_position_bits, Range{1, 24}, ProfileOnly{},
      "fewest bits per position coordinate where they follow from the edge lengths");
    v("least_uv_bits", s.least_uv_bits, Range{1, 24}, ProfileOnly{},
      "fewest bits per texture coordinate where they follow from the textures");
    v("normal_bits", s.normal_bits, Range{4, 16}, ProfileOnly{},
      "bits per normal component; quantized and meshopt: 8 or 16");
    v("tangent_bits", s.tangent_bits, Range{4, 16}, ProfileOnly{},
      "bits per tangent component; quantized and meshopt: 8 or 16");
    v("stream", s.stream,
      "clients refine the mesh by a stream of vertex splits; false: every scale is a GLB instead, and each "
      "finer one is fetched anew");
    v("glb", s.glb,
      "scales that stand in GLBs beside the stream, for viewers of glTF; steps: the finest are left out where "
      "all GLBs would take over 2.2 times the bytes of S_0's and 32 kB");
  }
};

}  // namespace texmesh
