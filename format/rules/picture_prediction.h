#pragma once

#include "format/documents/quality_table.h"

namespace texmesh {

// FLIP of lit pictures of a choice against S_0 with the source's texels, read between the samples of a
// quality table. Values at displayed heights between two of the table's are linear in the height's logarithm;
// outside of them the nearest height counts. Same bits on every machine.

/// The two displayed heights of a table around one, px; twice the same where the table has one. 1 px for a
/// table without any.
using SizesAround = std::array<double, 2>;
SizesAround sizes_around(const QualityTable& table, double displayed_px);

/// How many times larger the texels of a plane are on the screen than those that were sampled at each of
/// sizes_around(): a logarithm of base 2, 0 = as large, below 0 = smaller.
using TexelGrowth = std::array<double, 2>;

/// What textures of one group lose at one displayed height. A group that the table does not have loses its
/// texels' 1 - SSIM, and nothing by its mips.
class GroupCurve {
 public:
  GroupCurve(const QualityTable& table, PlaneGroup group, double displayed_px);
  /// What rungs add where the texels lose `texel_dssim` >= 0: FLIP, 0 for 0, along straight lines through the
  /// samples' logarithms. Before the first and behind the last sample the slope is 0.25 to 1: by a steeper
  /// one fragments that the preview shows well would seem to lose next to nothing. Twice as large texels lose
  /// kLossPerDoubling times as much, and half as large ones 1 / kLossPerHalving of it: what coarse quantisers
  /// take, finer texels do not bring back. 0..1, not falling.
  double coded(double texel_dssim, const TexelGrowth& growth = {}) const;
  /// FLIP where all textures of the group show their previews. Without the group 1.
  double preview() const;
  /// FLIP of the texels that rungs code, halved `mip` times. Between whole levels of growth linear, behind
  /// the coarsest sampled ones along the last line, or a steeper one: to the geometric mean of it and of
  /// preview() where the texels are as large as the preview's; less what texels of full size, so much
  /// smaller, would have beyond the finest sampled level. That level's for full size.
  double halved(const TexelGrowth& growth, std::uint32_t mip) const;
  static constexpr double kLossPerDoubling = 1.6, kLossPerHalving = 1.25;

 private:
  struct Curve {
    std::vector<double> log_dssim, log_flip;
    std::vector<double> mips;  // from the finest sampled level on; the last is the coarsest
    double finest_level = 0;   // of mips[0], beside the planes that were sampled: <= 0
    double preview = 0;
    double at(double texel_dssim) const;
    double at_level(double level, double preview_level) const;
  };
  std::vector<Curve> curves_;  // none, one, or those of the two heights around
  double part_ = 0;            // of the second one
};

/// FLIP of a scale with the source's texels. Scales between two of the table's are linear in the number; 0
/// for a table without scales.
double geometry_flip(const QualityTable& table, double displayed_px, double scale);

/// Losses of scale and groups together, by QualityTable::exponent; at most 1.
double combined_flip(const QualityTable& table, std::span<const double> losses);

}  // namespace texmesh
