#include "format/rules/proxy_choice.h"

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

constexpr int kMoments = 64;            // at which the time left is looked at
constexpr double kMeshTimeShare = 0.5;  // of the time left
constexpr double kPaying = 0.95;        // of the mean without a step
constexpr double kMostStepTime = 0.05;  // of the time left: what comes later takes too much from the end

std::uint64_t beyond_first_request(std::uint64_t begin, std::uint64_t bytes) {
  const std::uint64_t end = begin + bytes;
  return end - std::min(end, std::max(begin, kStartBytes));
}

/// Scales as they are supposed to come: nothing until the mesh is there, then from `first` to `last`.
struct ExpectedScales {
  double mesh_s = 0, end_s = 0;
  double first = 0, last = 0;
  double at(double t) const {
    if (t < mesh_s) return 1;
    if (t >= end_s) return last;
    return first * portable::pow(last / first, (t - mesh_s) / (end_s - mesh_s));
  }
};

class StepModel {
 public:
  StepModel(const Manifest& m, int wanted, double displayed_px, const StepLink& link)
      : m_(m), link_(link), fixed_bytes_(static_cast<double>(document_bytes(m))) {
    for (std::size_t k = 0; k < m.proxies.size(); ++k) flip_.push_back(proxy_loss(m, k, displayed_px).flip);
    // The finest mesh that leaves time for textures; the coarsest one comes with the documents.
    double mesh_bytes = 0;
    too_coarse_ = m.scales.back().scale > wanted;
    for (const ManifestScale& s : m.scales) {
      if (s.scale < wanted || &s == &m.scales.back()) continue;
      const auto bytes = static_cast<double>(s.glb.bytes);
      if (seconds(fixed_bytes_ + bytes) > kMeshTimeShare * link.left_s) continue;
      mesh_bytes = bytes;
      too_coarse_ = false;
      break;
    }
    fixed_bytes_ += mesh_bytes;
  }
  double flip(std::size_t proxy) const { return flip_[proxy]; }
  double arrival_s(std::size_t proxy) const {
    return seconds(static_cast<double>(proxy_bytes_beyond_start(m_, proxy)));
  }
  /// Mean FLIP in the time left; 0 = without a step.
  double mean(std::size_t step) const {
    const double step_s = step > 0 ? arrival_s(step) : 0;
    const ExpectedScales scales = scales_from(step_s);
    double sum = 0;
    for (int i = 0; i < kMoments; ++i) {
      const double t = (i + 0.5) / kMoments * link_.left_s;
      sum += t < step_s ? flip_[0] : std::min(flip_[step], scales.at(t));
    }
    return sum / kMoments;
  }

 private:
  double seconds(double bytes) const { return link_.rtt_s + bytes / link_.bytes_s; }
  /// What is asked for after `from_s`.
  ExpectedScales scales_from(double from_s) const {
    const auto largest = static_cast<double>(m_.proxies.back().glb.bytes);
    const auto all = static_cast<double>(m_.provenance.offset + m_.provenance.bytes);  // the last entry
    ExpectedScales out;
    out.mesh_s = from_s + seconds(fixed_bytes_);
    out.end_s = std::min(link_.left_s, out.mesh_s + all / link_.bytes_s);
    // Four scans' meshes with their previews were .6 to 1.2 times as far from the source as the largest
    // proxy.
    out.first = out.last = std::max(too_coarse_ ? flip_.front() : flip_.back(), 1e-6);
    if (too_coarse_) return out;
    // Four times the bytes lose half.
    const double bytes = std::min(all, (link_.left_s - from_s) * link_.bytes_s);
    out.last = std::max(1e-6, out.first * std::sqrt(largest / std::max(largest, bytes)));
    return out;
  }

  const Manifest& m_;
  StepLink link_;
  double fixed_bytes_;       // before the first picture of a scale
  bool too_coarse_ = false;  // the coarsest scale, as no finer one comes in time
  std::vector<double> flip_;
};

}  // namespace

ProxyLoss proxy_loss(const Manifest& manifest, std::size_t proxy, double displayed_px) {
  const ManifestProxy& p = manifest.proxies[proxy];
  return {loss_at(manifest.proxy_sizes_px, p.flip, displayed_px),
          loss_at(manifest.proxy_sizes_px, p.flip_p95, displayed_px)};
}

std::optional<std::size_t> serving_proxy(const Manifest& manifest, double displayed_px) {
  for (std::size_t k = 0; k < manifest.proxies.size(); ++k) {
    const ProxyLoss loss = proxy_loss(manifest, k, displayed_px);
    if (manifest.proxies[k].glb.bytes > kStartBytes) break;
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

std::uint64_t document_bytes(const Manifest& m) {
  const EntryRef& materials = m.scales.back().glb;
  return beyond_first_request(m.index.offset, m.tables.offset + m.tables.bytes - m.index.offset) +
         beyond_first_request(materials.offset, materials.bytes);
}

std::optional<std::size_t> proxy_step(const Manifest& m, int wanted, double displayed_px,
                                      const StepLink& link) {
  if (m.proxies.size() < 2 || !(link.left_s > 0) || !(link.bytes_s > 0)) return std::nullopt;
  const StepModel model(m, wanted, displayed_px, link);
  double least = kPaying * model.mean(0);
  std::optional<std::size_t> best;
  for (std::size_t k = 1; k < m.proxies.size(); ++k) {
    if (!(model.flip(k) < model.flip(0)) || model.arrival_s(k) >= kMostStepTime * link.left_s) continue;
    const double mean = model.mean(k);
    if (mean > least || (best && mean == least)) continue;
    least = mean;
    best = k;
  }
  return best;
}

}  // namespace texmesh
