#pragma once
#include <cstdint>
#include <optional>

#include "format/documents/manifest.h"

namespace texmesh {

// Which proxies are enough, from the numbers of the manifest alone (SPEC.md, A.6). Same bits on every
// machine.

/// FLIP of lit pictures of a proxy against S_0 with the source's textures: mean and 95th percentile, 0..1.
struct ProxyLoss {
  double flip = 0, flip_p95 = 0;
};
/// At a displayed height in px: between measured heights linear in the height's logarithm, below the first
/// one the first's, behind the last one more by kProxyLossPerDoubling for each doubling. `proxy` counts
/// Manifest::proxies.
ProxyLoss proxy_loss(const Manifest& manifest, std::size_t proxy, double displayed_px);
inline constexpr double kProxyLossPerDoubling = 1.6;

/// Lit pictures with at most these losses cannot be told from S_0's (SPEC.md, 5.5).
inline constexpr double kSameFlip = 0.05, kSameFlipP95 = 0.15;
/// The smallest proxy that cannot be told from S_0 at that height; nothing where there is none.
std::optional<std::size_t> serving_proxy(const Manifest& manifest, double displayed_px);

/// Bytes behind those of the first request that a client fetches for a proxy; the first picture, which comes
/// before every larger proxy, is not among them.
std::uint64_t proxy_bytes_beyond_start(const Manifest& manifest, std::size_t proxy);

}  // namespace texmesh
