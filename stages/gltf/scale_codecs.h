#pragma once
#include "stages/data/nested_scales.h"
#include "stages/data/scales_options.h"
#include "stages/gltf/glb_writer.h"

namespace texmesh {

using GltfJson = GlbWriter::Json;

/// A cube of evenly spaced places that coordinates are rounded to, the same for every scale and primitive, so
/// that a vertex that several scales share has the same bits in all of them.
struct QuantisationGrid {
  int bits = 0;  // 0 = coordinates stay floats
  Vec3f origin;
  float range = 1;  // side of the cube, > 0
  float step() const { return range / static_cast<float>((std::uint32_t{1} << bits) - 1); }
  /// Nearest place; in float, operation by operation as Draco's encoder and decoder compute.
  std::uint32_t index(float x, int axis) const;
  float value(std::uint32_t index, int axis) const {
    return static_cast<float>(index) * step() + origin[axis];
  }
  Vec3f rounded(Vec3f p) const;
  Vec3f place(Vec3f p) const;  // the three indices, as floats
};

/// Bits from the options, or so that a rounded position moves by at most 1/16 of the mean and 1/4 of the
/// shorter edges and 1/8 of the mean edge of any part that can be seen, and at most one triangle in a
/// thousand loses its area; but at least options.least_position_bits. `max_bits` is what the codec can hold;
/// where the edges need more, coordinates stay floats.
QuantisationGrid position_grid(const Mesh& mesh, const ScalesOptions& options, int max_bits);

/// Bits from the options, or so that a rounded texture coordinate moves by at most 1/8 texel of the largest
/// texture, and at least options.least_uv_bits. Floats only where max_bits do not hold even 1/4 texel.
QuantisationGrid uv_grid(const std::vector<Vec2f>& uv, double largest_texture_px,
                         const ScalesOptions& options, int max_bits);

/// Makes a grid coarser: as few bits as hold so many cells along an axis, at least 7.
void coarsen(QuantisationGrid& grid, double cells);
/// The same for the positions of these triangles, of which a tenth at most may lose their area: beside strays
/// the object is a speck.
void coarsen_positions(QuantisationGrid& grid, double cells, const Mesh& mesh,
                       const std::vector<Triangle>& triangles);

/// How far rounding moves a position at most, along an axis.
double largest_rounding(const Mesh& mesh, const QuantisationGrid& grid);

/// The triangles of one part and material. `indices` index `wedges`, which index the mesh's wedges.
struct ScalePrimitive {
  std::uint16_t part = 0, material = 0;
  std::vector<std::uint32_t> wedges, indices;
  std::vector<std::uint16_t> wedge_part;  // where parts are merged to one node: of each wedge; else empty
};

/// How the primitives of all scales are written; `frames` are those of the scale in hand.
struct ScaleCoding {
  const Mesh& mesh;
  ScalesOptions options;
  QuantisationGrid position, uv[2];
  bool write_uv[2] = {false, false};
  bool fine_colours = false;   // 16 bits, because 8 would change them
  std::vector<bool> tangents;  // per material: its primitives have them where their wedges do
  ScaleFrames frames;          // stand for the mesh's normals and tangents
  int draco_speed = 10 - ScalesOptions::draco_level;
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
