#pragma once
// Inside the room only: baked maps as pictures of a given size.

#include "stages/proxies/bake/bake.h"
#include "stages/proxies/coding/proxy_glb.h"

namespace texmesh {

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

/// All pictures at the highest quality that fits max_bytes, or at one whose pictures take at least 97.5 % of
/// them; at the lowest where none does.
ProxyPictures code_pictures(const MapPixels& maps, std::size_t max_bytes, CodedPictures& coded);

}  // namespace texmesh
