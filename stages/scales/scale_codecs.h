#pragma once
#include "stages/geometry/scale_frames.h"
#include "stages/gltf/glb_writer.h"
#include "stages/scales/scale_grid.h"

namespace texmesh {

/// The triangles of one part and material. `indices` index `wedges`, which index the mesh's wedges.
struct ScalePrimitive {
  std::uint16_t part = 0, material = 0;
  std::vector<std::uint32_t> wedges, indices;
  std::vector<std::uint16_t> wedge_part;  // where parts are merged to one node: of each wedge; else empty
};

/// How the primitives of all scales are written; `frames` are those of the scale in hand.
struct ScaleCoding {
  const Mesh& mesh;
  const ScalesOptions& options;
  QuantisationGrid position, uv[2];
  bool write_uv[2] = {false, false};
  bool fine_colours = false;   // 16 bits, because 8 would change them
  std::vector<bool> tangents;  // per material: its primitives have them where their wedges do
  ScaleFrames frames;          // stand for the mesh's normals and tangents
  /// Every wedge of the primitive has a tangent and its material needs it.
  bool writes_tangents(const ScalePrimitive& primitive) const;
  const std::vector<Vec2f>& uv_values(int set) const { return set == 0 ? mesh.uv0 : mesh.uv1; }
  bool positions_are_indices() const {  // the node's transform then leads from grid indices to positions
    return position.bits > 0 &&
           (options.mesh_codec == MeshCodec::kMeshopt || options.mesh_codec == MeshCodec::kQuantized);
  }
};

struct CodedPrimitive {
  GlbWriter::Json json;
  std::uint32_t triangles = 0, vertices = 0;  // as a decoder gives them
};

/// KHR_draco_mesh_compression with explicit quantisation. Throws StageError when Draco refuses.
CodedPrimitive code_draco(GlbWriter& writer, const ScaleCoding& coding, const ScalePrimitive& primitive);

/// KHR_mesh_quantization, the same under EXT_meshopt_compression, or plain floats, as the options say.
CodedPrimitive code_plain(GlbWriter& writer, const ScaleCoding& coding, ScalePrimitive primitive);

}  // namespace texmesh
