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
  std::uint32_t plane = 0;  // the plane that is fetched; == base for full size
};

/// Where an offer of the list comes from.
struct ListedFragment {
  std::uint32_t plane = 0, fragment = 0;
};

/// The F-list of a package at a scale: the stored fragments of all chosen planes in one list (thesis ch. 4),
/// ordered by eta x weight of the role x share of the surface. Fragments that look no better at any rung than
/// in the preview (1 - SSIM of the tables) are left out.
struct FragmentList {
  std::vector<FragmentOffer> offers;
  std::vector<ListedFragment> fragments;  // by offer
  double total_weight = 0;                // the loss where 1 - SSIM is 1 everywhere
  double preview_loss = 0;                // of the fragments left out, as the preview shows them
};

/// Weight of a role in the list and in losses: 1 for base colour, less for roles that change the picture
/// less.
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
/// object shows at most. A finer mip is never chosen, however many bytes are left. Measured on scans and
/// reduced to the display: at the bytes of the chosen mip's best rung, the next finer mip is within 0.004 of
/// the chosen mip's SSIM (0.974 to 0.990, 40 to 48 dB). 0.01 more of SSIM takes 2 to 3.5 times the bytes, and
/// nobody sees the difference.
std::vector<PlaneChoice> planes_for_display(PackageReader& package, double displayed_px);

/// The loss, as 1 - SSIM over the surface, that comes from showing mips in place of full-size textures. A mip
/// loses the share ((m - d) / (p - d))^1.45 of the preview's loss, for mip m, the preview's level p and the
/// level d that the display shows. (Measured on photogrammetry textures: mips 1, 2, 3 lose the shares 0.13,
/// 0.37, 0.78 at d = 0, p = 4.)
double mip_loss(PackageReader& package, const std::vector<PlaneChoice>& planes, double displayed_px);

/// The best texture that so many bytes can show.
struct TextureBudget {
  std::vector<PlaneChoice> planes;
  FragmentList list;
  std::vector<std::int32_t> rungs;  // by offer; -1 = skipped
  std::uint64_t bytes = 0;          // of fragments, at most the budget
  double dssim = 0;                 // predicted 1 - SSIM over the surface, loss by mips included
};
/// Chooses between the planes for the display and their mips, so that few bytes are not spread over too many
/// texels. Fragments share the bytes by rate and distortion (spend_bytes).
TextureBudget texture_for_budget(PackageReader& package, double displayed_px, const ListOptions& options,
                                 std::uint64_t bytes);

}  // namespace texmesh
