#include "format/rules/mip_choice.h"

#include <cmath>

#include "format/base/portable_math.h"

namespace texmesh {

double display_level(const PlaneTables& full_size, double surface_area, double object_height,
                     double displayed_px) {
  double texels = 0, surface = 0;
  for (std::size_t f = 0; f < full_size.fragment_count(); ++f) {
    texels += full_size.covered_texels[f];
    surface += full_size.surface_fraction[f];
  }
  if (!(surface > 0) || !(surface_area > 0) || !(texels > 0)) return 0;
  const double texels_per_unit = std::sqrt(texels / (surface * surface_area));
  return portable::log(texels_per_unit / (displayed_px / object_height)) / portable::kLn2;
}

std::uint32_t plane_at_level(std::span<const TextureInfo> textures, std::uint32_t base, double level) {
  std::uint32_t best = base, best_mip = 0;
  for (std::uint32_t p = 0; p < textures.size(); ++p) {
    const TextureInfo& t = textures[p];
    // A plane may lack its larger mips (small textures have none).
    if (t.mip == 0 || t.base != base || t.mip <= best_mip || static_cast<double>(t.mip) > level) continue;
    best_mip = t.mip;
    best = p;
  }
  return best;
}

}  // namespace texmesh
