#pragma once
// Inside the room only: one proxy of a given number of bytes.
#include <optional>
#include <vector>

#include "stages/proxies/charts/segment_charts.h"
#include "stages/proxies/coding/proxy_pictures.h"
#include "stages/proxies/measure/proxy_studio.h"

namespace texmesh::proxies {

/// How bytes are shared, and which maps there are. Fitted, see split_for().
struct ByteSplit {
  double mesh_share = 0.6;  // of the file
  MapChoice maps;
  MeshCoding mesh;
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

struct MadeProxy {
  Proxy proxy;       // without losses
  ShownModel shown;  // what it looks like
};

/// What all proxies of a model are made from.
struct ProxyWorkshop {
  const BakeSource& source;
  const MaterialGroups& groups;
  SurfaceLadder& surfaces;

  /// At most 2 % above `target_bytes`; nothing where no surface fits.
  std::optional<MadeProxy> make(std::uint64_t target_bytes, const ByteSplit& split,
                                const RunContext& context);
};

}  // namespace texmesh::proxies
