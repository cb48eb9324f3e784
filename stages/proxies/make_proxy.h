#pragma once
// Inside the room only: one proxy of a given number of bytes, how it looks beside S_0, and how a nested scale
// with the source's atlas looks for the same bytes.
#include "stages/data/proxies.h"
#include "stages/proxies/coding/proxy_glb.h"
#include "stages/render/shade.h"

namespace texmesh {

/// A mesh with materials and textures of its own.
struct ShownModel {
  Mesh mesh;
  ShownMaterials shown;
  RenderScene scene() const { return render_scene(mesh, shown.materials, shown.textures.size()); }
};

/// What a viewer gets of a proxy's file.
ShownModel shown_proxy(const AtlasMesh& mesh, const RoundedMesh& rounded,
                       const std::vector<MaterialGroup>& groups, const ProxyPictures& pictures);

/// Displayed heights of the longest side of the bounding box.
inline constexpr double kSmallPx = 128, kMiddlePx = 256, kLargePx = 512;

/// Pictures of S_0 at one displayed height, from four sides; at kLargePx from two. Constant once made.
struct ReferenceViews {
  struct View {
    RenderCamera camera;
    std::uint32_t side_px = 0;
    FlipPicture picture;
  };
  RenderEnvironment environment;
  std::vector<View> views;
};
ReferenceViews reference_views(const Mesh& mesh, const ShownMaterials& shown, double displayed_px,
                               const RunContext& context);

/// What pictures of the scene from the same places differ by. Half of the views will do where their mean is
/// more than `hopeless`.
FlipSum picture_loss(const ReferenceViews& reference, const RenderScene& scene,
                     const std::vector<RenderTexture>& textures, const RunContext& context,
                     double hopeless = 1);

/// What bytes buy of nested scales and of textures without losses of coding.
struct RivalPrices {
  double mesh = 1;              // times an estimate of Draco's meshes
  double bits_per_texel = 1.2;  // of a JPEG of middle quality, the texels of the whole image
  double besides = 0;           // bytes of what else is fetched
  double loss = 1;              // by coding, times FLIP
};

/// Nested scales with textures that a proxy's bytes buy. Bytes are estimated, and textures are those of the
/// mip that fits, without losses of coding. By the default prices such a scale is better than the real one.
/// Losses are mean FLIP beside `views`.
class CompetingScales {
 public:
  /// All must outlive it.
  CompetingScales(const NestedScales& scales, const ShownMaterials& shown, const ReferenceViews& views);

  /// Whether one of them loses at most as much as a proxy of so many bytes.
  bool win(std::uint64_t bytes, double flip, const RivalPrices& prices, const RunContext& context);
  /// Whether the likeliest one does; the others are not looked at.
  bool likeliest_wins(std::uint64_t bytes, double flip, const RivalPrices& prices, const RunContext& context);
  /// What plans of a package with proxies pay for a scale that looks like those: besides mesh and textures
  /// they take tables and the coarsest scale's mesh, with which materials come.
  RivalPrices prices_in_plans() const;

 private:
  struct Competitor {
    std::size_t scale = 0, dropped_levels = 0;  // of the textures
    auto operator<=>(const Competitor&) const = default;
  };
  std::vector<Competitor> competitors(std::uint64_t bytes, const RivalPrices& prices) const;
  double flip_of(const Competitor& competitor, double flip, const RunContext& context);

  const NestedScales& scales_;
  const ShownMaterials& shown_;
  const ReferenceViews& views_;
  std::vector<double> mesh_bytes_;      // per scale
  std::map<Competitor, double> known_;  // FLIP of all views; found once
};

/// Bytes of S_0's whole mesh, coded; within 20 % for scans.
double whole_mesh_bytes(const NestedScales& scales);

/// Whether S_0's whole mesh, coded, leaves so much of the bytes to the source's textures that no atlas of
/// a proxy's own can win. An atlas in pieces costs more than its texels, so it leaves its proxies a chance
/// for longer.
bool whole_mesh_is_small(const NestedScales& scales, std::uint64_t bytes);

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
