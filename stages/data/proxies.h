#pragma once

#include "format/base/bytes.h"
#include "format/base/note.h"

namespace texmesh {

/// One picture inside a proxy's file.
struct ProxyTexture {
  std::string use;  // "base-colour", "metallic-roughness", "normal" or "emissive"
  std::uint32_t width_px = 0, height_px = 0;
  std::uint64_t bytes = 0;  // of the image file
  friend bool operator==(const ProxyTexture&, const ProxyTexture&) = default;
  static void archive(auto& s, auto& a) { a(s.use, s.width_px, s.height_px, s.bytes); }
};

/// Lit FLIP against S_0 with the source's texels, over the pixels of all views that either picture covers.
struct ProxyPictureLoss {
  double displayed_px = 0;  // height of the object in the pictures
  double flip_mean = 0, flip_p95 = 0;
  friend bool operator==(const ProxyPictureLoss&, const ProxyPictureLoss&) = default;
  static void archive(auto& s, auto& a) { a(s.displayed_px, s.flip_mean, s.flip_p95); }
};

/// The whole object in one small file: a coarse mesh with an atlas of its own and textures baked from S_0, or
/// a scale with the source's images made smaller.
struct Proxy {
  Bytes glb;                       // glTF 2.0 binary with its pictures inside, in the mesh's local frame
  std::uint64_t target_bytes = 0;  // what it was made for
  std::uint32_t triangles = 0, vertices = 0;  // as stored
  std::vector<ProxyTexture> textures;
  std::vector<ProxyPictureLoss> losses;  // by rising displayed_px, the same sizes in all proxies of a model
  static void archive(auto& s, auto& a) {
    a(s.glb, s.target_bytes, s.triangles, s.vertices, s.textures, s.losses);
  }
};

struct Proxies {
  std::vector<Proxy> proxies;  // strictly rising in bytes
  Notes notes;                 // why a size has none
  static void archive(auto& s, auto& a) { a(s.proxies, s.notes); }
};

}  // namespace texmesh
