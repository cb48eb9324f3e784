#pragma once
// Inside the room only: S_0 as the baker asks for it, and what it shows as the texels of an atlas.
#include <compare>
#include <memory>

#include "stages/charts/charts.h"
#include "stages/charts/texture_frame.h"
#include "stages/geometry/triangle_tree.h"
#include "stages/render/render_texture.h"

namespace texmesh {

/// Materials that one material of a proxy may stand for.
struct MaterialGroup {
  bool unlit = false, double_sided = false;
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  friend auto operator<=>(const MaterialGroup&, const MaterialGroup&) = default;
};
MaterialGroup group_of(const RenderMaterial& material);

/// Groups in rising order, and the group of each triangle of a mesh.
struct MaterialGroups {
  std::vector<MaterialGroup> groups;
  std::vector<std::uint32_t> triangle_group;
  bool mip_levels = true;  // whether viewers read textures with them
};
MaterialGroups find_groups(const Mesh& mesh, const std::vector<RenderMaterial>& materials);

/// What of a sample is asked for; the rest stays as it is made.
struct SampleParts {
  bool colours = true;  // base colour, alpha, emission
  bool data = true;     // occlusion, metallic, roughness
  bool normal = true;
};

/// What S_0 shows in one place, linear.
struct BakeSample {
  Vec3f base_colour{1, 1, 1}, emission;
  float alpha = 1;  // of a mask 0 or 1
  float occlusion = 1, metallic = 0, roughness = 1;
  Vec3f normal;  // unit, what a normal map makes of it
};

/// A place on S_0.
struct SurfacePlace {
  std::uint32_t triangle = 0;      // of the mesh
  std::array<double, 3> weight{};  // of its corners
};

/// S_0 with trees of its groups. All that it is made of must outlive it. Safe to ask from many threads; same
/// bits on every machine.
class BakeSource {
 public:
  BakeSource(const Mesh& mesh, const ShownMaterials& shown, const MaterialGroups& groups);

  /// Where a surface of the group shows S_0, seen from p along its unit normal: within the cage, 3 % of the
  /// diagonal to both sides, the nearest triangle on the line that looks the same way; else the closest point
  /// of those that do, else the closest point. Triangles without area are not there. Nothing for a group
  /// without triangles. `guess`: a place that was found nearby; it changes nothing but the time.
  std::optional<SurfacePlace> find(std::uint32_t group, Vec3d p, Vec3d normal,
                                   const std::optional<SurfacePlace>& guess) const;

  /// Textures are read at the mip whose texels are as large as `footprint`, object units.
  BakeSample sample(const SurfacePlace& place, double footprint, const SampleParts& parts) const;

  double diagonal() const { return diagonal_; }

 private:
  struct Group {
    std::vector<std::uint32_t> triangles;  // of the tree's
    std::unique_ptr<TriangleTree> tree;    // null: none
  };
  class Reader;
  void add_colours(Reader& reader, const RenderMaterial& material, BakeSample& out) const;
  void add_data(Reader& reader, const RenderMaterial& material, BakeSample& out) const;
  Vec3f mapped_normal(Reader& reader, const RenderMaterial& material) const;

  const Mesh& mesh_;
  const ShownMaterials& shown_;
  std::vector<Group> groups_;
  std::vector<std::uint32_t> tree_index_;  // per triangle: its index in its group's tree
  double diagonal_ = 0;
};

/// A mesh with unit normals per vertex. Vertices at creases stand there once for each side.
struct SmoothMesh {
  AtlasMesh mesh;
  std::vector<Vec3f> normals;
  /// Of a vertex; its number.
  std::uint32_t add_copy(std::uint32_t vertex);
};

/// Which creases of S_0 have normals of their own on each side. With a normal map only those at which charts
/// end: the map shows the others, and their vertices would take bytes (a helmet of 150 kB: FLIP .057 for
/// .059).
enum class CreaseUse : std::uint8_t { kAll, kWhereChartsEnd };

/// Normals are means of what S_0 shows, normal maps included, on the triangles around, each sample by its
/// corner's share. Triangles between which S_0 turns at once by 20 degrees or more have normals of their own.
/// Across charts, vertices of one position and group share them. Same bits for any thread count.
SmoothMesh sampled_normals(const AtlasMesh& mesh, const BakeSource& source, CreaseUse use,
                           const RunContext& context);

/// Texels of an atlas, row by row from the top; all lists are width_px * height_px long and hold a
/// continuation of the charts everywhere. Linear.
struct BakedMaps {
  std::uint32_t width_px = 0, height_px = 0;
  std::vector<Vec3f> base_colour, emission;
  std::vector<Vec3f> occlusion_roughness_metallic;  // as the channels of glTF's ORM textures
  std::vector<Vec3f> normal;                        // tangent space, unit, +Y up; empty where not asked for
  std::vector<float> alpha;
  std::vector<std::uint8_t> covered;    // 1 = a chart shows here
  Vec3f mean_orm, least_orm, most_orm;  // over covered texels
  Vec3f most_emission;                  // largest of each channel over all texels
  bool has_alpha = false, has_emission = false;
};

/// What is wanted of the maps. About `samples` places in all are looked at, at most 16 a texel.
struct BakeOrder {
  std::size_t samples = 0;
  bool normal_map = true;
};

/// Bakes at the atlas' own size. Each texel is the mean of several places of its part of the charts.
/// `normals` are those of the vertices; the normals' texels fit
/// the frames that renderers derive of triangles without tangents. Same bits for any thread count and
/// machine.
BakedMaps bake(const AtlasMesh& mesh, const std::vector<Vec3f>& normals, const BakeSource& source,
               const BakeOrder& order, const RunContext& context);

/// Gives every value whose `covered` is 0 a smooth continuation of the others (Gortler et al. 1996); the
/// others stay. Without any covered value nothing changes. Lists are width * height long.
void push_pull(std::vector<Vec3f>& values, const std::vector<std::uint8_t>& covered, std::uint32_t width,
               std::uint32_t height);

}  // namespace texmesh
