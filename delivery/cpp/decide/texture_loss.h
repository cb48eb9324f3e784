#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "format/rules/picture_prediction.h"

namespace texmesh {

/// Which plane shows each texture: the full-size one or a mip of it.
struct PlaneChoice {
  std::uint32_t base = 0;   // full-size plane
  std::uint32_t plane = 0;  // the plane that is fetched; == base for full size
};

/// Every texture at full size.
std::vector<PlaneChoice> full_size(PackageReader& package);
/// The smallest mips that still have a texel for every pixel where the object is displayed `displayed_px`
/// high (device pixels): by the texels and the share of the surface of each texture, and the surface that the
/// object shows at most. A finer mip is never chosen, however many bytes are left.
std::vector<PlaneChoice> planes_for_display(PackageReader& package, double displayed_px);

/// A number for each group of planes, by PlaneGroup.
using PerGroup = std::array<double, kPlaneGroups>;
/// The same, with each group's planes so many mips coarser than planes_for_display(), as far as there are
/// any.
std::vector<PlaneChoice> planes_coarser(PackageReader& package, double displayed_px,
                                        const std::array<int, kPlaneGroups>& levels);

/// What textures lose in lit pictures: FLIP of each group by itself, on S_0.
struct TextureParts {
  PerGroup coded{};    // because of their rungs
  PerGroup coarser{};  // because their mips are coarser than those for the display
};
/// FLIP of the textures alone, and of a scale with them: 0 = equal to S_0 with the source's texels, 1 = as
/// different as can be.
double texture_flip(const QualityTable& table, const TextureParts& parts);
double picture_flip(const QualityTable& table, double displayed_px, int scale, const TextureParts& parts);

/// What fragments lose in lit pictures of one displayed height, by the package's quality table.
class TextureLoss {
 public:
  /// `displayed_px` > 0. The package must outlive this.
  TextureLoss(PackageReader& package, double displayed_px);

  /// Of a plane: FLIP of an object that looks all over like one fragment.
  struct Plane {
    std::vector<float> weights;  // [F] surface_weights()
    double weight = 0;           // of the stored fragments together
    std::vector<double> coded;   // [(rungs + 1) * F], index way * F + fragment; way 0 shows the preview
  };
  PlaneGroup group_of(std::uint32_t plane) const;
  const Plane& plane(std::uint32_t plane);
  /// The weight of each group's stored fragments.
  PerGroup weights(const std::vector<PlaneChoice>& planes);
  /// TextureParts::coarser, as the mean over each group's surface.
  PerGroup coarser(const std::vector<PlaneChoice>& planes);
  /// How much larger the plane's texels are at this height than those that the quality table sampled.
  TexelGrowth growth(std::uint32_t plane);
  double displayed_px() const { return displayed_px_; }
  PackageReader& package() { return package_; }

 private:
  PackageReader& package_;
  double displayed_px_ = 0;
  std::array<GroupCurve, kPlaneGroups> curves_;
  std::map<std::uint32_t, Plane> planes_;
  std::map<std::uint32_t, double> preview_means_;

  double preview_mean(std::uint32_t plane);
  double preview_loss(std::uint32_t plane);
};

}  // namespace texmesh
