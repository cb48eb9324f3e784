#pragma once
// Inside the room only: one proxy of a given number of bytes.
#include <array>
#include <optional>
#include <vector>

#include "stages/proxies/bake/bake.h"
#include "stages/proxies/charts/segment_charts.h"
#include "stages/proxies/coding/proxy_pictures.h"
#include "stages/proxies/measure/proxy_studio.h"

namespace texmesh::proxies {

/// What a proxy is made of. Fitted, see forms_of().
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

/// Surfaces of one simplification run, finest first, whose charts are made when they are asked for.
class SurfaceLadder {
 public:
  /// About twenty surfaces between `least` and `most` triangles.
  SurfaceLadder(const Mesh& mesh, const MaterialGroups& groups, std::uint32_t least, std::uint32_t most,
                const RunContext& context);
  /// The finest surface with at most so many triangles, or the coarsest. Null where no triangle is left.
  const ChartedSurface* at_most(double triangles, const RunContext& context);

 private:
  std::vector<ProxySurface> surfaces_;
  std::vector<std::optional<ChartedSurface>> charted_;
};

/// All of a proxy that bytes do not depend on.
struct BakedProxy {
  const ChartedSurface* charted = nullptr;  // of the ladder
  double mesh_bytes = 0;                    // coded in the form that it was made for
  AtlasMesh atlas;
  SmoothMesh smooth;  // the same with normals
  BakedMaps maps;
  // What finish() has coded, for the next form.
  std::array<std::optional<CodedMesh>, 2> meshes;  // without normals, with them
  CodedPictures pictures;
};

struct MadeProxy {
  Proxy proxy;       // without losses
  ShownModel shown;  // what it looks like
  int quality = 0;   // of the pictures
};

/// Makes the proxies of a model, and learns from each what the next one's parts will cost.
class ProxyWorkshop {
 public:
  /// All must outlive the workshop.
  ProxyWorkshop(const BakeSource& source, const MaterialGroups& groups, SurfaceLadder& surfaces);

  /// Nothing where no triangle is left or charts cannot be packed.
  std::optional<BakedProxy> bake(double target_bytes, const ProxyForm& form, const RunContext& context);
  /// At most 2 % above `target_bytes`, or nothing. `form` may differ from the one baked for by normals, and
  /// by a normal map where one was baked.
  std::optional<MadeProxy> finish(BakedProxy& baked, std::uint64_t target_bytes, const ProxyForm& form);
  /// What a size's textures took at their quality says how large those of the next one can be.
  void learn(const MadeProxy& made);

 private:
  CodedMesh coded_mesh(const BakedProxy& baked, const ProxyForm& form) const;
  std::uint32_t texture_side(double bytes, const MapChoice& maps) const;
  std::optional<BakedProxy> coded(double mesh_bytes, std::uint32_t side_px, const ProxyForm& form,
                                  const RunContext& context);

  const BakeSource& source_;
  const MaterialGroups& groups_;
  SurfaceLadder& surfaces_;
  double texel_bits_ = 1;                                      // times those of an ordinary texture
  std::array<std::array<double, 2>, 2> bytes_per_triangle_{};  // by Draco, by normals; 0 = not known
};

}  // namespace texmesh::proxies
