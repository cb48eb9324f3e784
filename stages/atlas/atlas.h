#pragma once
#include "stages/data/conditioned_mesh.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kAtlasVersion = 1;

/// Whose charts the package has: the source's or new ones. compile_model() decides for kAuto (atlas_choice).
enum class AtlasMode : std::uint8_t { kKeep, kRebuild, kAuto };
template <>
struct EnumNames<AtlasMode> {
  static constexpr std::array<std::string_view, 3> names{"keep", "rebuild", "auto"};
};

/// The notes of a new atlas, and of one that was asked for and not made; and what a new one's files are not.
inline constexpr const char* kRebuiltAtlasNote = "atlas-rebuilt";
inline constexpr const char* kKeptAtlasNote = "atlas-kept";
inline constexpr const char* kLostByRebuilding =
    "The source's own files of its textures are not in the package, and new texels differ a little from them";

struct AtlasOptions {
  AtlasMode mode = AtlasMode::kKeep;
  double density = 1;
  static void fields(auto& s, auto&& v) {
    v("mode", s.mode,
      "keep = the source's charts and textures; rebuild = few large charts, whose texels are read from the "
      "source's; auto = rebuild where lit pictures of 200 kB to 1 MB then look better, else keep");
    v("density", s.density, Range{0.25, 2}, ProfileOnly{},
      "texels of a rebuilt atlas along a line on the surface, by those that the source has there");
  }
  friend bool operator==(const AtlasOptions&, const AtlasOptions&) = default;
};

/// A model with the same surface, triangle for triangle, and perhaps other charts and textures.
struct ChartedModel {
  ConditionedMesh mesh;
  std::vector<Material> materials;
  std::vector<Image> images;
  Notes notes;
};

/// Cuts the surface into few, large charts, packs them, and reads their texels from the source's textures
/// through the same triangles.
/// - Mesh: positions, triangles, parts, normals and colours stay, in their order. Wedges that differed by
///   the source's charts alone are one. The only texture coordinates are uv0, within 0..1; no tangents.
/// - Materials that differ in name and in images alone become one. Others stay apart, and so do those
///   without textures.
/// - Images: JPEGs as fine as the source's, else PNGs of 8 bits, one for each picture of a material, square,
/// at most 8192 px. What does not fit
///   gets further pages, each with a material of its own. Every image of a material keeps its size beside
///   the largest one's.
/// - Density: each chart has so many texels as the source's triangles there have in all. Places that share
///   texels of the source, by tiles or mirrored charts, get texels of their own; where that is more than
///   twice the source's images, all charts get fewer.
/// - Normal maps are turned to the new axes, and fit the frames that renderers derive of triangles without
///   tangents.
/// What is kept as it is, with a note that says why: a model without textures or texture coordinates, with
/// textures that are not interpolated, or with directions in material extensions. `mode` kKeep and
/// kAuto give the model back. Same bytes for any thread count and machine. Throws InputError for an image
/// that does not decode.
ChartedModel chart_model(const ConditionedMesh& mesh, const std::vector<Material>& materials,
                         const std::vector<Image>& images, const AtlasOptions& options,
                         const RunContext& context);

}  // namespace texmesh
