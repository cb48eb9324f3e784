#pragma once

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
/// object shows at most. That is a mean: where texels are dense in one place and sparse in another, finer
/// mips still show more. Each group's planes are `levels` coarser than that, or finer where below 0, as far
/// as there are any.
std::vector<PlaneChoice> planes_for_display(PackageReader& package, double displayed_px,
                                            const std::array<int, kPlaneGroups>& levels = {});

/// A number for each group of planes, by PlaneGroup.
using PerGroup = std::array<double, kPlaneGroups>;

/// FLIP of the textures alone, and of a scale with them: 0 = equal to S_0 with the source's texels, 1 = as
/// different as can be. `losses`: what the textures of each group lose by themselves, on S_0.
double texture_flip(const QualityTable& table, const PerGroup& losses);
double picture_flip(const QualityTable& table, double displayed_px, int scale, const PerGroup& losses);

/// What fragments lose in lit pictures of one displayed height, by the package's quality table.
class TextureLoss {
 public:
  /// `displayed_px` > 0. The package must outlive this.
  TextureLoss(PackageReader& package, double displayed_px);

  /// Of a plane: FLIP of an object that looks all over like one fragment.
  struct Plane {
    std::vector<float> weights;  // [F] surface_weights()
    double weight = 0;           // of the stored fragments together
    /// [(rungs + 1) * F], index way * F + fragment; way 0 shows the preview, others lose by their mip and
    /// by their rung.
    std::vector<double> shown;
  };
  PlaneGroup group_of(std::uint32_t plane) const;
  const Plane& plane(std::uint32_t plane);
  /// What a mip loses of the source's texels; 0 for full size.
  double mip(std::uint32_t plane);
  /// The weight of each group's stored fragments.
  PerGroup weights(const std::vector<PlaneChoice>& planes);
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
