#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/data/conditioned_mesh.h"
#include "stages/data/fragments.h"
#include "stages/data/nested_scales.h"
#include "stages/data/pixels.h"
#include "stages/data/scale_map.h"
#include "stages/data/skeleton.h"
#include "stages/measure/atlas/atlas_figures.h"

namespace texmesh {

// What a stage computed as something to look at: `texmesh debug`.

enum class DebugQuantity : std::uint8_t {
  kPersistence,
  kSkeleton,
  kRadius,
  kCollapseError,
  kFragments,
  kAtlas
};
inline constexpr std::array<std::string_view, 6> kDebugNames{"persistence",    "skeleton",  "R",
                                                             "collapse-error", "fragments", "atlas"};

using Srgb = std::array<std::uint8_t, 3>;

/// What the colours mean. Values outside lo..hi have the colour of the nearer end.
struct DebugLegend {
  std::string quantity, unit;  // unit "" = a plain number
  double lo = 0, hi = 1;
  bool logarithmic = false, coloured = true;   // coloured = false: there is no scale of colours
  std::vector<std::pair<double, Srgb>> stops;  // rising values
  std::vector<std::string> remarks;            // sentences without a final full stop
};

/// A mesh whose colours (or painted textures) show something, and lines beside it. Pictures are a
/// function of it.
struct DebugView {
  Mesh mesh;                        // colours: linear RGBA per wedge; empty where textures show
  std::vector<Material> materials;  // for mesh.triangle_material; texture refs index `textures`
  std::vector<Pixels> textures;     // 3 channels, sRGB
  bool shows_layout = false;        // the textures themselves say something: a PNG has them, too
  bool translucent = false;         // lines inside the mesh must be seen through it
  std::vector<Vec3f> nodes;
  std::vector<std::array<std::uint32_t, 2>> lines;  // both ends equal = a point
  DebugLegend legend;
};

/// The scale of colours: dark blue for 0, through green, to yellow for 1; brightness rises all the way.
Srgb colour_of(double fraction);

/// Features are painted as far as half the distance that they keep from others of their scale.
DebugView view_persistence(const ConditionedMesh& mesh, const ScaleMap& scale_map);
DebugView view_skeleton(const ConditionedMesh& mesh, const Skeleton& skeleton);
DebugView view_radius(const ConditionedMesh& mesh, const Skeleton& skeleton);
DebugView view_collapse_error(const NestedScales& scales);
/// eta of feature scale 0 painted over the texture, with the grid's lines (debug_fragments.cpp).
DebugView view_fragments(const ConditionedMesh& mesh, const std::vector<Material>& materials,
                         const std::vector<Image>& images, const Fragments& fragments);
/// The same from a package: S_0's mesh, previews and tables.
DebugView view_fragments(PackageReader& package, const RunContext& context);

/// Every chart in a colour of its own, thin ones red, texels of two places magenta (debug_atlas.cpp).
/// `images`: sides, as measure_atlases() takes them. InputError for a mesh without an atlas.
DebugView view_atlas(const Mesh& mesh, const std::vector<Material>& materials,
                     std::span<const AtlasImage> images);
DebugView view_atlas(PackageReader& package, const RunContext& context);

/// GLB: the mesh (COLOR_0 or textures), then the lines as a primitive of mode LINES in a node "lines".
std::vector<std::uint8_t> write_debug_glb(const DebugView& view);
/// Two views side by side from opposite sides, a little from above, each side_px wide, by stages/render with
/// a light at the camera; lines are drawn over the mesh. A bar at the right shows the scale of colours, hi at
/// the top, as the tone mapping makes them. With shows_layout the first four textures stand at the right,
/// each within side_px.
std::vector<std::uint8_t> write_debug_png(const DebugView& view, std::uint32_t side_px);

}  // namespace texmesh
