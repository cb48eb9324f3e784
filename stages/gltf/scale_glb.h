#pragma once
// A nested scale as a GLB: one node a part, one primitive a part and material, the source's materials.

#include "stages/gltf/scale_codecs.h"

namespace texmesh {

/// One image of a GLB, made once for all scales.
struct GlbImage {
  std::uint32_t image = 0;  // source image: named "texture/<image>"
  std::uint32_t plane = 0;  // whose preview it is, preview/PPP.jpg; a PNG is no entry
  const char* mime_type = "";
  std::vector<std::uint8_t> bytes;
  std::string uri;  // "" = embedded
};
using GlbImages = std::vector<GlbImage>;

/// Largest factor by which a material stretches texture coordinates, times the largest image's side.
double largest_texture_px(const std::vector<Material>& materials, const std::vector<Image>& images, int set);

/// 8 bits lose something of these colours.
bool needs_fine_colours(const std::vector<Vec4f>& colours);

/// Grids as the options ask, or as edges and textures need; without frames.
ScaleCoding make_coding(const Mesh& mesh, const std::vector<Material>& materials,
                        const std::vector<Image>& images, const ScalesOptions& options);

/// Above this many parts they are merged: each costs 0.8 KB of JSON and a code stream of its own in every
/// scale (a SketchUp model of 5,391 groups took 5.9 MB per scale, 4.2 MB of it JSON). The names then stand in
/// the mesh's extras, and a feature id per vertex (EXT_mesh_features) says which is whose.
constexpr std::size_t kMostNodes = 256;
bool parts_merged(const Mesh& mesh);

/// Two corners in one place.
bool is_flat(Vec3f a, Vec3f b, Vec3f c);

/// The file of a scale. Textures whose coordinates or images do not exist are left out. Factors are clipped
/// to the ranges of glTF. StageError when nothing is left on the grid.
ScaleFile write_scale(const ScaleCoding& coding, const NestedScale& scale,
                      const std::vector<Material>& materials, const GlbImages& images);

/// The mesh of a scale about as a reader of its file gets it: on the grids, with normals of so many bits,
/// which Draco rounds a little otherwise. Tangents and colours stay as they are.
Mesh rounded_scale(Mesh mesh, const ScaleCoding& coding);

}  // namespace texmesh
