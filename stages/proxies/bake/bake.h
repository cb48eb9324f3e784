#pragma once
// Inside the room only: what S_0 shows, as the texels of an atlas.
#include "stages/proxies/atlas_mesh.h"
#include "stages/proxies/bake/bake_source.h"

namespace texmesh {

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
