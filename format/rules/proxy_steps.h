#pragma once
#include <cstdint>
#include <optional>

#include "format/documents/manifest.h"

namespace texmesh {

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

/// The proxy that lowers the mean FLIP of what is seen in the time left by at least a twentieth, of several
/// the one that lowers it most; nothing where none does. `wanted`: the finest scale that is worth showing.
/// What scales look like is supposed, see SPEC.md.
std::optional<std::size_t> proxy_step(const Manifest& manifest, int wanted, double displayed_px,
                                      const StepLink& link);

}  // namespace texmesh
