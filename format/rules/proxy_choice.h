#pragma once

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
/// The smallest proxy that cannot be told from S_0 at that height, of at most kStartBytes; nothing where
/// there is none. A load does not end with a larger file, for one of three times its bytes is twice as near.
std::optional<std::size_t> serving_proxy(const Manifest& manifest, double displayed_px);

/// Bytes behind those of the first request that a client fetches for a proxy; the first picture, which comes
/// before every larger proxy, is not among them.
std::uint64_t proxy_bytes_beyond_start(const Manifest& manifest, std::size_t proxy);

// Which larger proxy is shown on the way from the smallest one to a scale, from the numbers of the manifest
// alone (SPEC.md, A.6): documents, which could tell more, take longer than the proxy. Same bits on every
// machine.

/// A link as the first request has shown it, and the seconds that are left until the time limit.
struct StepLink {
  double bytes_s = 0;  // > 0
  double rtt_s = 0;
  double left_s = 0;
};

/// Bytes behind those of the first request that a client of a package with proxies fetches before it can
/// decide about scales and textures: from the index to the tables' end, and the coarsest scale's GLB.
std::uint64_t document_bytes(const Manifest& manifest);

/// The proxy that comes in the first twentieth of the time left and lowers the mean FLIP of what is seen in
/// that time by at least a twentieth, of several the one that lowers it most; nothing where none does.
/// `wanted`: the finest scale that is worth showing. What scales look like is supposed, see SPEC.md.
std::optional<std::size_t> proxy_step(const Manifest& manifest, int wanted, double displayed_px,
                                      const StepLink& link);

}  // namespace texmesh
