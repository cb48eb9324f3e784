#pragma once
#include "format/documents/tables.h"
#include "format/split/split_stream.h"
#include "stages/data/fragments.h"
#include "stages/data/gltf_scales.h"
#include "stages/data/nested_scales.h"
#include "stages/data/perceptual_values.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"
#include "stages/data/scales_options.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kScalesVersion = 10;
inline constexpr int kGltfScalesVersion = 6;

/// Writes all kept scales as a stream of vertex splits, and S_0 and the coarsest as GLBs. Every kept scale is
/// a GLB where there is no stream.
/// - Node k is part k, without a mesh where the scale has no triangle of the part; a primitive per material
/// in
///   it. Above 256 parts there is one node for all: its mesh lists the names of those that are left in
///   extras.partNames, and its vertices have feature ids.
/// - The source's materials, with the previews of the planes as images (RGBA PNG where a material needs
///   alpha): embedded in the coarsest, elsewhere as "../preview/PPP.jpg". A GLB image is named "texture/<k>"
///   for source image k.
/// - Positions are quantised on one grid for all scales, so shared vertices are bit-equal between scales.
///   Triangles with two corners in one place of the grid are left out, and a note says how many of S_0's.
///   Positions stay in the local frame (Mesh::origin is the manifest's).
/// - Texture coordinates of unused sets are left out, and textures whose coordinates the mesh does not have.
/// - Normals and tangents of coarse scales are fitted: see stages/geometry/scale_frames.h. Those of the
/// stream
///   are S_0's.
/// - Tangents of the source are kept where a normal map needs them. A source without them gets none: viewers
///   then shade by the triangles' own. The stream has none: readers make them (make_tangents()).
/// - draco = KHR_draco_mesh_compression; quantized = KHR_mesh_quantization; meshopt = the same under
///   EXT_meshopt_compression; none = plain floats.
/// - The stream (format/split/split_stream.h) holds the same scales on the same grid, or on one of 24 bits
///   where the files have floats. There is none, and a note says so, when only one scale is kept or it would
///   break the format's bounds.
/// Throws StageError when nothing is left on the grid. Same bytes for any thread count.
ScaleFiles write_scales(const NestedScales& scales, const PerceptualValues& perceptual,
                        const std::vector<Material>& materials, const std::vector<Image>& images,
                        const Fragments& fragments, const Previews& previews, const ScalesOptions& options,
                        const RunContext& context);

/// GLBs of the scales between S_0 and the coarsest that `options.glb` names, for viewers that know glTF and
/// nothing of packages; none where there is no stream, because all scales are GLBs then.
/// - Meshes are as write_scales() would have written them, but where a scale has a step on grids of half a
///   pixel at the switch size and of half a texel, and with normals of 7 to 9 bits; positions are finer where
///   over a tenth of the triangles would lose their area.
/// - With ScaleGlbs::kSteps the finest are left out, with a note each, until all GLBs, S_0's and the coarsest
///   among them, take at most kMostOverFinest times S_0's bytes, and kAnywayBytes for the previews inside a
///   small model's coarsest GLB.
/// - A scale of the step function has textures that hold at its switch size: the least for which the quality
///   table says a FLIP of kGltfFlip (format/rules/whole_textures.h). Other scales have previews.
/// - Textures are previews or JPEGs of planes, each once however many GLBs show it: "../preview/PPP.jpg" and
///   "PPP-rRR.jpg". An image with alpha is embedded, as in other GLBs.
/// Same bytes for any thread count.
inline constexpr double kGltfFlip = 0.08, kMostOverFinest = 2.2, kAnywayBytes = 32e3;
GltfScales write_gltf_scales(const NestedScales& scales, const PerceptualValues& perceptual,
                             const std::vector<Material>& materials, const std::vector<Image>& images,
                             const Fragments& fragments, const std::vector<Pixels>& filled,
                             const Previews& previews, const PackageTables& tables, const ScaleFiles& files,
                             const MeasuredQuality& quality, const ScalesOptions& options,
                             const RunContext& context);

/// A mesh that lies on the grids of a stream's head (split_model), as the GLB that write_scales() would have
/// written, with the tangents that the mesh has, but without images and with nameless materials: as many as
/// its triangles count. `hasty`: Draco hardly compresses it, which serves where it is coded again soon.
/// Throws StageError when nothing is left on the grid.
std::vector<std::uint8_t> write_streamed_scale(const Mesh& mesh, const SplitStreamHead& head,
                                               const ScalesOptions& options, bool hasty = false);

}  // namespace texmesh
