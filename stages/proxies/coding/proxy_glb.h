#pragma once
// Inside the room only: a proxy as a file.
#include "stages/proxies/bake/bake_source.h"
#include "stages/proxies/coding/proxy_mesh.h"

namespace texmesh::proxies {

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

}  // namespace texmesh::proxies
