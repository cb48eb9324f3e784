#pragma once

#include "delivery/cpp/decide/harmonic_time.h"
#include "delivery/cpp/decide/texture_loss.h"

namespace texmesh {

/// Where an offer of the list comes from.
struct ListedFragment {
  std::uint32_t plane = 0, fragment = 0;
};

/// The F-list of a package at a scale: the stored fragments of all chosen planes in one list (thesis ch. 4).
/// Fragments that look no better at any rung than in the preview (1 - SSIM of the tables) are left out.
///
/// A fragment's losses are its part of what its group of planes loses in lit pictures of the display,
/// times the group's weight: share of the group's surface x FLIP of an object that
/// looks all over like the fragment. Eta is feature density x what showing the fragment saves of that.
struct FragmentList {
  std::vector<FragmentOffer> offers;
  std::vector<ListedFragment> fragments;  // by offer
  std::vector<PlaneGroup> groups;         // by offer
  PerGroup group_weights{1, 1, 1};        // ListOptions::group_weights
  PerGroup preview_loss{};                // of the fragments left out, as the preview shows them, unweighted
};

/// Quality of lists as printed, at most.
inline constexpr double kHighestPrinted = 97;

struct ListOptions {
  int scale = 0;                               // number of a scale of the package
  double displayed_px = 1000;                  // > 0: height of the object
  double gamma = -1;                           // of q_i(x, y); -1 = the mean of eta
  double quality_low = 5, quality_high = 100;  // limits, see HtcOptions::hard_limits
  /// > 0: what a group's losses weigh beside the others', see TextureBudget.
  PerGroup group_weights{1, 1, 1};
  // true: chapter 4's list as printed, for Policy::kThesis. Every stored fragment is in the list, whatever it
  // saves; eta is that of (3.1), or VQP where the tables go by it, less Gamma; F-bar, whose eta is nearest
  // Gamma, gets Q_i; the limits are Q_i - dQ and Q_i + dQ within quality_low and kHighestPrinted.
  bool thesis = false;
};
FragmentList fragment_list(PackageReader& package, const std::vector<PlaneChoice>& planes,
                           const ListOptions& options);
/// `loss` is for options.displayed_px.
FragmentList fragment_list(TextureLoss& loss, const std::vector<PlaneChoice>& planes,
                           const ListOptions& options);

/// The Gamma whose list comes to so many bytes, D_i(Gamma) = D_1 = T_0 beta_0, by bisection over the sizes
/// that the tables tell of q_i(x, y): 0 where even that list has fewer, 1 where even that has more. All
/// textures have the same Gamma.
double gamma_for_bytes(PackageReader& package, const std::vector<PlaneChoice>& planes, int scale,
                       double bytes);

/// What each group loses where the offers have these rungs; -1 = skipped.
PerGroup losses_of(const FragmentList& list, std::span<const std::int32_t> rungs);

}  // namespace texmesh
