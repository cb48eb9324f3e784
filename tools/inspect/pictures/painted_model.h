#pragma once

#include "delivery/cpp/package/package_reader.h"
#include "pipeline/compile/compile_model.h"
#include "stages/measure/atlas/atlas_figures.h"

namespace texmesh {

// What a stage computed as something to look at: `texmesh render --what`, and `texmesh-lab picture`.

using Srgb = std::array<std::uint8_t, 3>;

/// A value of the scale of colours, its colour, and what people call that.
struct LegendStop {
  double value = 0;
  Srgb colour{};
  const char* name = "";
};

/// What the colours mean. Values outside lo..hi have the colour of the nearer end.
struct ColourLegend {
  std::string quantity, unit = {};  // unit "" = a plain number
  double lo = 0, hi = 1;
  bool logarithmic = false, coloured = true;  // coloured = false: there is no scale of colours
  std::vector<LegendStop> stops = {};         // rising values
  std::vector<std::string> remarks = {};      // sentences without a final full stop
};

/// A vertex as data: the value that is painted there (NaN = none), where it is in the texture, 0 without
/// coordinates, and where it is in the source.
struct PaintedPoint {
  double value = 0;
  Vec2f texture;
  Vec3d at;
};

/// A mesh whose colours (or painted textures) show something, and lines beside it. Pictures are a
/// function of it.
struct PaintedModel {
  Mesh mesh;                        // colours: linear RGBA per wedge; empty where textures show
  std::vector<Material> materials;  // for mesh.triangle_material; texture refs index `textures`
  std::vector<Pixels> textures;     // 3 channels, sRGB
  bool shows_layout = false;        // the textures themselves say something: a PNG has them, too
  bool translucent = false;         // lines inside the mesh must be seen through it
  std::vector<Vec3f> nodes;
  std::vector<std::array<std::uint32_t, 2>> lines;  // both ends equal = a point
  std::vector<PaintedPoint> points;                 // per position; empty where textures are painted
  ColourLegend legend;
};

/// The colour of 0..1 (clipped) on a scale of two or more colours at equal distances.
Srgb colour_on(std::span<const Srgb> scale, double fraction);
/// The scale of colours: dark violet for 0, over teal, to yellow for 1; brightness rises all the way.
Srgb colour_of(double fraction);

/// "#rrggbb"
std::string hex_of(Srgb colour);

/// The mesh alone, one matt material, colours from a value per position; the legend gets its stops.
/// StageError where the number of values is another; `what` names them in the message.
PaintedModel paint_values(const Mesh& source, const std::vector<double>& value, ColourLegend legend,
                          const char* what);
/// "12.5 %"
std::string share_text(double count, double of);

/// Up to which scale a vertex stays a feature. Features are painted as far as half the distance that they
/// keep from others of their scale.
PaintedModel paint_scales(const ConditionedMesh& mesh, const ScaleMap& scale_map);
/// eta of feature scale 0 painted over the texture, with the grid's lines.
PaintedModel paint_fragments(const ConditionedMesh& mesh, const std::vector<Material>& materials,
                             const std::vector<Image>& images, const Fragments& fragments);
/// The same from a package: S_0's mesh, previews and tables.
PaintedModel paint_fragments(PackageReader& package, const RunContext& context);
/// Every chart in a colour of its own, thin ones red, texels of two places magenta. `images`: sides, as
/// measure_atlases() takes them. InputError for a mesh without an atlas.
PaintedModel paint_atlas(const Mesh& mesh, const std::vector<Material>& materials,
                         std::span<const AtlasImage> images);
PaintedModel paint_atlas(PackageReader& package, const RunContext& context);

/// GLB: the mesh (COLOR_0 or textures), then the lines as a primitive of mode LINES in a node "lines".
std::vector<std::uint8_t> write_painted_glb(const PaintedModel& model);
/// Two views side by side from opposite sides, a little from above, each side_px wide; lines are drawn over
/// the mesh. A bar at the right shows the scale of colours, hi at the top. With shows_layout the first four
/// textures stand at the right, each within side_px.
std::vector<std::uint8_t> write_painted_png(const PaintedModel& model, std::uint32_t side_px);

/// The points as lines of value,tx,ty,gx,gy,gz under a line of these names (the scale map of the thesis's
/// chapter 3, where scales are painted), or as vertices of an ASCII PLY. `what` is the value's name.
/// InputError where there are none.
std::string write_painted_csv(const PaintedModel& model, const std::string& what);
std::string write_painted_ply(const PaintedModel& model, const std::string& what);

inline constexpr Artefact<PaintedModel> kPainted{"painted"};

/// The stage that paints a quantity from what it reads.
template <class... Read>
Stage painting_stage(Inputs<Read...> read, PaintedModel (*paint)(const Read&...)) {
  return make_stage({kPainted.name, 1, "what a stage computed, to look at"}, read, derived(kPainted),
                    options(), {},
                    [paint](const Read&... objects, const RunContext&) { return paint(objects...); });
}

/// Something that can be painted.
struct PaintedQuantity {
  std::string_view name;
  Stage (*stage)();
  PaintedModel (*of_package)(PackageReader&, const RunContext&);  // nullptr: a package does not hold this
};
/// atlas, fragments, scales.
std::span<const PaintedQuantity> painted_quantities();

/// Runs the graph over a model up to the stage whose result is painted, and no further; results of a compile
/// with the same options come from the store. Errors as compile_model.
PaintedModel paint_model(const CompileRequest& request, const PaintedQuantity& what, Store& store,
                         const RunContext& context, const StageObserver& observer, Notes& notes);
/// Of a package. InputError says what to do instead where a package does not hold the quantity.
PaintedModel paint_package(const std::string& path, const PaintedQuantity& what, const RunContext& context);

}  // namespace texmesh
