#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "delivery/cpp/decide/harmonic_time.h"
#include "delivery/cpp/package/package_reader.h"

namespace texmesh {

/// Which plane shows each texture: the full-size one or a mip of it.
struct PlaneChoice {
  std::uint32_t base = 0;   // full-size plane
  std::uint32_t plane = 0;  // what is fetched; == base for full size
};

/// Where an offer of the list comes from.
struct ListedFragment {
  std::uint32_t plane = 0, fragment = 0;
};

/// The F-list of a package at a scale: the stored fragments of all chosen planes in one list (thesis ch. 4),
/// ordered by eta x weight of the role x share of the surface. Fragments of which no rung shows more than the
/// preview does (1 - SSIM of the tables) are left to it.
struct FragmentList {
  std::vector<FragmentOffer> offers;
  std::vector<ListedFragment> fragments;  // by offer
  double total_weight = 0;                // of the losses: a loss of this is 1 - SSIM = 1 everywhere
  double preview_loss = 0;  // of fragments not in the list: no rung shows more of them than the preview
};

/// What a role counts for in the list and in losses: 1 for base colour, less for what changes
/// the picture less.
double role_weight(const std::string& role);

struct ListOptions {
  int scale = 0;
  double gamma = -1;                          // of q_i(x, y); -1 = the mean of eta
  double quality_low = 5, quality_high = 97;  // limits, see HtcOptions::hard_limits
};
FragmentList fragment_list(PackageReader& package, const std::vector<PlaneChoice>& planes,
                           const ListOptions& options);

/// Every texture at full size.
std::vector<PlaneChoice> full_size(PackageReader& package);
/// The smallest mips that still have a texel for every pixel where the object is displayed `displayed_px`
/// high (device pixels): by the texels and the share of the surface of each texture, and the surface that the
/// object shows at most. Never a finer one, however many bytes are left: reduced to the display, the next
/// finer size of scans at the bytes of this one's best rung is within 0.004 of its SSIM (0.974 to 0.990, 40
/// to 48 dB); 0.01 more takes 2 to 3.5 times the bytes, and nobody sees it. Who comes closer gets that size.
std::vector<PlaneChoice> planes_for_display(PackageReader& package, double displayed_px);

/// What the picture loses, as 1 - SSIM over the surface, because mips stand for textures that have more
/// texels than that: of what the preview in their place would lose, the share ((m - d) / (p - d))^1.45 for
/// mip m, the preview's level p and the level d that the display shows (measured on photogrammetry textures:
/// the shares of mips 1, 2, 3 were 0.13, 0.37, 0.78 at d = 0, p = 4).
double mip_loss(PackageReader& package, const std::vector<PlaneChoice>& planes, double displayed_px);

/// The best texture that so many bytes can show.
struct TextureBudget {
  std::vector<PlaneChoice> planes;
  FragmentList list;
  std::vector<std::int32_t> rungs;  // by offer; -1 = skipped
  std::uint64_t bytes = 0;          // of fragments, at most the budget
  double dssim = 0;                 // predicted 1 - SSIM over the surface, loss by mips included
};
/// Chooses between the planes for the display and their mips, so that few bytes are not spread over texels
/// that they cannot make good; fragments share the bytes by rate and distortion (spend_bytes).
TextureBudget texture_for_budget(PackageReader& package, double displayed_px, const ListOptions& options,
                                 std::uint64_t bytes);

}  // namespace texmesh
