#pragma once
// Inside the room only: S_0 as the baker asks for it.
#include <compare>
#include <memory>

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

/// The directions of a triangle's texture axes across a normal, as renderers derive them from the texture
/// coordinates (Schueler 2013): the longer one is unit, none is where the coordinates have no area.
struct TextureFrame {
  Vec3d along_u, along_v;
};
TextureFrame texture_frame(const std::array<Vec3d, 3>& corner, const std::array<Vec2d, 3>& uv, Vec3d normal);

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

}  // namespace texmesh
