#pragma once
#include <cstdint>
#include <string>

#include "pipeline/import/import.h"
#include "tests/support/images.h"
#include "tests/support/memory_resolver.h"

namespace texmesh::testing {

inline Model import_text(const std::string& text, Resolver& resolver, const ImportOptions& options = {}) {
  return import_obj("a.obj", bytes_of(text), resolver, options, {}).model;
}
inline Model import_text(const std::string& text) {
  MemoryResolver resolver;
  return import_text(text, resolver);
}

inline const std::string kVertices = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
inline const std::string kTextured = "mtllib a.mtl\n" + kVertices + "usemtl m\nf 1/1 2/2 3/3 4/4\n";

/// 8 x 8 texels of one value.
inline Bytes filled_png(int channels, const Bytes& texel) {
  Bytes samples;
  for (int i = 0; i < 64; ++i) samples.insert(samples.end(), texel.begin(), texel.end());
  OIIO::ImageSpec attributes;
  attributes.attribute("oiio:UnassociatedAlpha", 1);
  return encode_image("png", 8, 8, channels, samples, OIIO::TypeDesc::UINT8, attributes);
}

/// The model of kTextured with `mtl` behind "newmtl m" and pictures to refer to.
struct MtlCase {
  MemoryResolver resolver;
  Model model;
  explicit MtlCase(const std::string& mtl, const ImportOptions& options = {},
                   const std::string& before = "") {
    resolver.files["a.mtl"] = bytes_of(before + "newmtl m\n" + mtl);
    resolver.files["c.png"] = png_bytes(8, 8, 3);
    resolver.files["a b.png"] = png_bytes(8, 4, 3);
    resolver.files["normal.png"] = filled_png(3, {127, 130, 250});
    resolver.files["height.png"] = filled_png(1, {90});
    resolver.files["brown.png"] = filled_png(3, {120, 90, 60});
    resolver.files["cutout.png"] = [] {
      Bytes samples;
      for (int i = 0; i < 64; ++i)
        samples.insert(samples.end(), {10, 200, 30, static_cast<std::uint8_t>(i % 2 ? 255 : 0)});
      OIIO::ImageSpec attributes;
      attributes.attribute("oiio:UnassociatedAlpha", 1);
      return encode_image("png", 8, 8, 4, samples, OIIO::TypeDesc::UINT8, attributes);
    }();
    resolver.files["glass.png"] = filled_png(4, {9, 9, 9, 100});
    resolver.files["opaque.png"] = filled_png(4, {9, 9, 9, 255});
    model = import_text(kTextured, resolver, options);
  }
  const Material& material() const { return model.materials.at(0); }
  std::string image_name() const {
    const TextureRef& ref = material().base_colour_texture;
    return ref.used() ? model.images.at(static_cast<std::size_t>(ref.image)).name : "none";
  }
};

}  // namespace texmesh::testing
