#pragma once

#include "format/documents/quality_table.h"
#include "format/documents/tables.h"
#include "format/documents/textures.h"

namespace texmesh {

/// A texture as one picture: a plane of it at one rung, or its preview.
struct WholeTexture {
  static constexpr std::uint32_t kPreview = ~std::uint32_t{0};
  std::uint32_t base = 0;         // full-size plane
  std::uint32_t plane = 0;        // that plane or a mip of it
  std::uint32_t rung = kPreview;  // kPreview: what the plane is does not matter
  friend bool operator==(const WholeTexture&, const WholeTexture&) = default;
};

/// What is known of an object and its textures; `textures` have their roles, mips and bases.
struct TexturedObject {
  const QualityTable& quality;
  const std::vector<TextureInfo>& textures;
  const std::vector<PlaneTables>& tables;  // as many
  double surface_area = 0, height = 0;     // object units, as the manifest's
};

/// The textures of least bytes with which the scale, displayed `displayed_px` high, has a FLIP of at most
/// `most_flip` by picture_prediction.h; where there are none such, those of least FLIP. Each group of planes
/// has one level of mips, from those that clients show at that height to four coarser ones, and one rung, as
/// far as a plane has so many; or its previews. One for each full-size plane whose image has no alpha plane.
/// Same result on every machine.
std::vector<WholeTexture> least_textures(const TexturedObject& object, int scale, double displayed_px,
                                         double most_flip);

}  // namespace texmesh
