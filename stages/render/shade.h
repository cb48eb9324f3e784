#pragma once
#include "stages/measure/flip.h"
#include "stages/render/environment.h"
#include "stages/render/render_texture.h"

namespace texmesh {

/// The picture of what is seen, with these textures; `textures` are the scene's texture_count, and one
/// without levels counts as white (a normal map as flat).
/// Materials: glTF 2.0, appendix B (GGX, height-correlated Smith, Schlick, Lambert), with what three.js r170
/// adds: a floor of roughness, roughness of the geometry, multiple scattering (Fdez-Aguera 2019), specular
/// occlusion (Lagarde 2014). Each triangle is shaded once a pixel, at the mean of its samples; of an opaque
/// pixel with more than four of them, in pictures of more than 200 px, the four with most samples stand for
/// all of it. Colours are tone-mapped (Khronos PBR Neutral) and cut to 0..1 there; a pixel is the mean of its
/// samples in linear light. Blending mixes sRGB-encoded values, as browsers' canvases do. A pixel is covered
/// where something with an alpha above 0 is seen. Uncovered samples show the environment's background. NaN
/// never comes out. Same bits on every machine and for any thread count.
Picture shade(const RenderScene& scene, const Visibility& visibility,
              const std::vector<RenderTexture>& textures, const RenderEnvironment& environment,
              const RunContext& context);

/// Several pictures of one view. Only the pixels that show something are kept, 13 bytes each a picture: a
/// dozen whole pictures 1300 px high would take 260 MB.
class PictureVariants {
 public:
  /// Pictures of the background alone, whose shown pixels are still to be set. `visibility` tells which
  /// pixels show something.
  PictureVariants(const Visibility& visibility, std::size_t count, Vec3f background);
  std::size_t count() const { return shown_.size(); }
  /// The whole picture.
  Picture picture(std::size_t variant) const;
  /// The same in place of another of these pictures, or of an empty one: what both show of the background
  /// stays.
  void put(std::size_t variant, Picture& picture) const;
  /// Of all these pictures at once: what shown_spans() finds in one, or more.
  PixelSpans spans() const;

  /// Places of the shown pixels in the pictures, rising.
  const std::vector<std::uint32_t>& places() const { return places_; }
  /// `at` indexes places(). Different threads may set different pixels.
  void set(std::size_t variant, std::size_t at, Vec3f linear, bool covered) {
    shown_[variant].linear[at] = linear;
    shown_[variant].covered[at] = covered;
  }

 private:
  struct Shown {
    std::vector<Vec3f> linear;          // by place
    std::vector<std::uint8_t> covered;  // the same
  };
  std::uint32_t side_px_;
  Vec3f background_;
  std::vector<std::uint32_t> places_;
  std::vector<Shown> shown_;
};

/// shade() with each of several lists of materials, which differ from the scene's in the textures of their
/// slots alone. Costs less, since what the pictures have in common is worked out once.
/// std::invalid_argument for a list of another length.
PictureVariants shade_variants(const RenderScene& scene, const Visibility& visibility,
                               std::span<const std::vector<RenderMaterial>* const> variants,
                               const std::vector<RenderTexture>& textures,
                               const RenderEnvironment& environment, const RunContext& context);

/// Khronos PBR Neutral of linear RGB >= 0, cut to 0..1.
Vec3f tone_mapped(Vec3f linear);

/// RGB of 8 bits, sRGB encoded, rounded to nearest.
Pixels encode_srgb(const Picture& picture);

}  // namespace texmesh
