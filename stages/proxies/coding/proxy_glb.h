#pragma once
// Inside the room only: a proxy as a file, with baked maps as pictures of a given size.
#include "format/base/bytes.h"
#include "stages/gltf/draco_mesh.h"
#include "stages/proxies/bake/bake.h"

namespace texmesh {

/// One stream. `packed` is what the file holds; decoded it has count * stride bytes.
struct MeshStream {
  Bytes packed;
  std::size_t stride = 0, count = 0;
};

/// How a mesh is stored. Draco takes half of meshopt's bytes and a decoder that clients load.
struct MeshCoding {
  bool draco = false;
  int position_bits = 12;  // 4..16, along the longest side of the box
};

/// The triangles of one group.
struct CodedGroup {
  std::uint32_t group = 0;
  bool has_normals = false;
  /// Per vertex three u16 on the positions' grid, two bytes of 0, two u16 on the coordinates' grid; with
  /// normals three i8, normalised, and a byte of 0.
  MeshStream vertex_stream;
  MeshStream indices;                            // u16 or u32
  DracoStream draco;                             // instead of both, where it is not empty
  std::array<std::uint32_t, 3> least{}, most{};  // of the positions
  bool is_draco() const { return !draco.bytes.empty(); }
  std::size_t triangles() const { return is_draco() ? draco.triangles : indices.count / 3; }
  std::size_t vertices() const { return is_draco() ? draco.vertices : vertex_stream.count; }
};

/// position = origin + step * grid place; of meshopt, uv = uv_step * grid place.
struct CodedMesh {
  Vec3f origin;
  float step = 1;
  Vec2f uv_step;
  std::vector<CodedGroup> groups;  // rising; none without triangles
  std::size_t bytes() const;       // of all packed streams
};

/// `normals`: per vertex, unit; empty for none. `with_normals`: per group. Triangles with two corners in one
/// place of the grid go. No group is left where nothing is left.
/// What Draco refuses is coded by meshopt.
CodedMesh code_mesh(const AtlasMesh& mesh, const std::vector<Vec3f>& normals,
                    const std::vector<bool>& with_normals, const MeshCoding& coding);

/// The mesh that a reader gets: positions, normals and coordinates rounded as coded, but no triangle gone.
struct RoundedMesh {
  std::vector<Vec3f> positions, normals;
  std::vector<Vec2f> uvs;
};
RoundedMesh rounded_mesh(const AtlasMesh& mesh, const std::vector<Vec3f>& normals, const MeshCoding& coding);

/// A coded picture: lossy WebP.
struct ProxyImage {
  Bytes file;
  std::uint32_t width_px = 0, height_px = 0;
};

/// All that one material reads; what is not there is a factor. All groups share the pictures.
struct ProxyPictures {
  ProxyImage base_colour;
  std::optional<ProxyImage> orm;  // occlusion, roughness, metallic
  std::optional<ProxyImage> normal, emission;
  float metallic = 0, roughness = 1;  // where there is no `orm`
  Vec3f emissive;                     // what emission is to be multiplied by
  int quality = 0;                    // that of the base colour, 0..100
  bool mip_levels = true;             // whether viewers are to read them with mip levels
  std::size_t bytes() const;
};

/// A GLB with everything inside: one node, one mesh, a primitive and a material per group.
Bytes proxy_glb(const CodedMesh& mesh, const std::vector<MaterialGroup>& groups,
                const ProxyPictures& pictures);

/// Which maps get a picture of their own. Without `orm`, half of the occlusion is multiplied into the base
/// colour, and metal and roughness are means.
struct MapChoice {
  bool orm = false, normal = false;
};

/// Maps of 8 bits.
struct MapPixels {
  MapChoice choice;
  Pixels base_colour;  // RGB, or RGBA where there is alpha; sRGB
  Pixels orm, normal;  // plain numbers; empty where not chosen
  Pixels emission;     // sRGB, over `emissive`; empty where nothing glows
  Vec3f emissive;      // 0..1
  float metallic = 0, roughness = 1;
};
MapPixels map_pixels(const BakedMaps& maps, const MapChoice& choice);

/// Pictures of one bake's maps, which are coded once at each quality, and the quality that was chosen last.
/// Maps of all choices that agree on `orm` may share it.
struct CodedPictures {
  std::array<std::map<int, ProxyImage>, 4> images;  // by map, by quality
  int last_quality = 0;                             // 0 = none
};

/// The highest quality of those tried, from `first`, at which fill(quality), the logarithm of the bytes as
/// parts of those that are asked for, is at most 0; nothing where none is. `nearer(quality, fill)` guesses
/// the next one. Ends with one that is at least `full`.
std::optional<int> fullest(int low, int high, int first, int tries, double full, const auto& fill,
                           const auto& nearer) {
  std::optional<int> best;
  for (int at = first; tries > 0 && low <= high; --tries) {
    const double found = fill(at);
    if (found <= 0) best = at;
    if (found <= 0 && found >= full) break;
    (found <= 0 ? low : high) = found <= 0 ? at + 1 : at - 1;
    at = std::clamp(static_cast<int>(std::floor(nearer(at, found) + 0.5)), low, std::max(low, high));
  }
  return best;
}

/// All pictures at the highest quality that fits max_bytes, or at one whose pictures take at least 97.5 % of
/// them; at the lowest where none does.
ProxyPictures code_pictures(const MapPixels& maps, std::size_t max_bytes, CodedPictures& coded);

}  // namespace texmesh
