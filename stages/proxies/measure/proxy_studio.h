#pragma once
// Inside the room only: how a proxy looks beside S_0.
#include <array>
#include <vector>

#include "stages/data/proxies.h"
#include "stages/measure/flip.h"
#include "stages/proxies/coding/proxy_glb.h"
#include "stages/render/materials/shown_materials.h"
#include "stages/render/shade.h"

namespace texmesh::proxies {

/// A mesh with materials and textures of its own.
struct ShownModel {
  Mesh mesh;
  ShownMaterials shown;
};

/// What a viewer gets of a proxy's file.
ShownModel shown_proxy(const AtlasMesh& mesh, const RoundedMesh& rounded,
                       const std::vector<MaterialGroup>& groups, const ProxyPictures& pictures);

/// Pictures of S_0 from all sides, and what others differ from them.
class ProxyStudio {
 public:
  static constexpr std::array<double, 3> kDisplayedPx{128, 256, 512};
  static constexpr std::size_t kMiddle = 1, kLarge = 2;

  /// S_0 must outlive the studio.
  ProxyStudio(const Mesh& mesh, const ShownMaterials& shown);

  /// At one of the displayed heights: four views, at the largest one two. Half of the views will do where
  /// their mean is more than `hopeless`.
  FlipSum compare(const RenderScene& scene, const std::vector<RenderTexture>& textures, std::size_t size,
                  const RunContext& context, double hopeless = 1);
  FlipSum at_middle(const ShownModel& model, const RunContext& context, double hopeless = 1);
  /// At all of them, of which the middle one is known.
  std::vector<ProxyPictureLoss> losses(const ShownModel& model, const FlipSum& middle,
                                       const RunContext& context);

 private:
  struct View {
    RenderCamera camera;
    std::uint32_t side_px = 0;
    FlipPicture reference;
  };
  const std::vector<View>& views(std::size_t size, const RunContext& context);

  const Mesh& mesh_;
  const ShownMaterials& shown_;
  RenderEnvironment environment_;
  std::array<std::vector<View>, 3> views_;  // made when they are asked for
};

}  // namespace texmesh::proxies
