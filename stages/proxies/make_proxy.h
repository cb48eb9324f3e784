#pragma once
// Inside the room only: one proxy of a given number of bytes.
#include "stages/data/proxies.h"
#include "stages/proxies/coding/proxy_glb.h"
#include "stages/render/scale_pictures.h"

namespace texmesh {

inline constexpr double kOverAsked = 1.02;  // most bytes of a file, times those asked for

/// A mesh with materials and textures of its own.
struct ShownModel {
  Mesh mesh;
  ShownMaterials shown;
  RenderScene scene() const { return render_scene(mesh, shown.materials, shown.textures.size()); }
};

/// What a viewer gets of a proxy's file.
ShownModel shown_proxy(const AtlasMesh& mesh, const RoundedMesh& rounded,
                       const std::vector<MaterialGroup>& groups, const ProxyPictures& pictures);

/// What a proxy is made of. Fitted, see first_form() and best_of() in proxies.cpp.
struct ProxyForm {
  double mesh_share = 0.6;  // of the file
  MapChoice maps;
  MeshCoding coding;
  bool normals = true;  // of vertices; without, triangles are flat
};

/// A coarse surface with its charts.
struct ChartedSurface {
  ProxySurface surface;
  SurfaceCharts charts;
};

/// Surfaces of one simplification run, finest first. The charts of one are made when it is first asked for.
class CoarseSurfaces {
 public:
  /// About twenty surfaces between `least` and `most` triangles.
  CoarseSurfaces(const Mesh& mesh, const MaterialGroups& groups, std::uint32_t least, std::uint32_t most,
                 const RunContext& context);
  /// The finest surface with at most so many triangles, or the coarsest. Null where no triangle is left.
  const ChartedSurface* at_most(double triangles, const RunContext& context);

 private:
  std::vector<ProxySurface> surfaces_;
  std::vector<std::optional<ChartedSurface>> charted_;
};

/// What the parts of a proxy's file cost, as far as those made before it tell.
struct ProxyCosts {
  double texel_bits = 1;                                      // times those of an ordinary texture
  std::array<std::array<double, 2>, 2> bytes_per_triangle{};  // by Draco, by normals; 0 = not known
};

/// All of a proxy that bytes do not depend on.
struct BakedProxy {
  const ChartedSurface* charted = nullptr;  // of the surfaces
  double mesh_bytes = 0;                    // coded in the form that it was made for
  AtlasMesh atlas;
  SmoothMesh smooth;  // the same with normals
  BakedMaps maps;
  // What finish_proxy() has coded, for the next form.
  std::array<std::optional<CodedMesh>, 2> meshes;  // without normals, with them
  CodedPictures pictures;
};

/// Nothing where no triangle is left or charts cannot be packed. `costs`: learns what a triangle takes.
std::optional<BakedProxy> bake_proxy(const BakeSource& source, const MaterialGroups& groups,
                                     CoarseSurfaces& surfaces, ProxyCosts& costs, double target_bytes,
                                     const ProxyForm& form, const RunContext& context);

struct MadeProxy {
  Proxy proxy;       // without losses
  ShownModel shown;  // what it looks like
  int quality = 0;   // of the pictures
};

/// At most 2 % above `target_bytes`, or nothing. `form` may differ from the one baked for by normals, and by
/// a normal map where one was baked.
std::optional<MadeProxy> finish_proxy(BakedProxy& baked, const MaterialGroups& groups,
                                      std::uint64_t target_bytes, const ProxyForm& form);

/// How large textures are, times ordinary ones: what those of a proxy took at their quality. Nothing where
/// they tell nothing.
std::optional<double> texel_bits_of(const MadeProxy& made);

/// Whether vertices' normals turn within triangles on at least half of the area: a surface without facets.
bool is_smooth(const Mesh& mesh);

}  // namespace texmesh
