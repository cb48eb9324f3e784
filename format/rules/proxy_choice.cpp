#include "format/rules/proxy_choice.h"

#include <algorithm>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

double loss_at(const std::vector<double>& sizes, const std::vector<double>& losses, double displayed_px) {
  const double px = std::max(displayed_px, 1.0);
  if (px <= sizes.front()) return losses.front();
  if (px >= sizes.back()) {
    const double doublings = portable::log(px / sizes.back()) / portable::kLn2;
    return std::min(1.0, losses.back() * portable::pow(kProxyLossPerDoubling, doublings));
  }
  std::size_t i = 0;
  while (sizes[i + 1] < px) ++i;
  const double from = portable::log(sizes[i]);
  const double part = (portable::log(px) - from) / (portable::log(sizes[i + 1]) - from);
  return (1 - part) * losses[i] + part * losses[i + 1];
}

}  // namespace

ProxyLoss proxy_loss(const Manifest& manifest, std::size_t proxy, double displayed_px) {
  const ManifestProxy& p = manifest.proxies[proxy];
  return {loss_at(manifest.proxy_sizes_px, p.flip, displayed_px),
          loss_at(manifest.proxy_sizes_px, p.flip_p95, displayed_px)};
}

std::optional<std::size_t> serving_proxy(const Manifest& manifest, double displayed_px) {
  for (std::size_t k = 0; k < manifest.proxies.size(); ++k) {
    const ProxyLoss loss = proxy_loss(manifest, k, displayed_px);
    if (loss.flip <= kSameFlip && loss.flip_p95 <= kSameFlipP95) return k;
  }
  return std::nullopt;
}

std::uint64_t proxy_bytes_beyond_start(const Manifest& manifest, std::size_t proxy) {
  if (proxy == 0) return 0;  // the first picture
  const EntryRef& glb = manifest.proxies[proxy].glb;
  const std::uint64_t end = glb.offset + glb.bytes;
  return end - std::min(end, std::max(glb.offset, kStartBytes));
}

}  // namespace texmesh
