#include "stages/simplification/scale_error.h"

#include "stages/base/parallel.h"
#include "stages/geometry/component_boxes.h"
#include "stages/geometry/distance.h"

namespace texmesh {
namespace {

// Per scale and direction: the rms is within 2 % then; the largest distance is that of a sample.
constexpr std::size_t kErrorSamples = 4000;

/// A point of S_0 and the component that it lies on.
struct Probe {
  Vec3d point;
  std::uint32_t component;
  std::uint32_t position;  // near the point
};

using Hint = SurfaceDistance::Hint;
/// A chain of hints begins anew with every so many samples, wherever the threads' pieces begin.
constexpr std::size_t kHintChain = 64;

Vec3d place(const Mesh& mesh, const std::vector<Triangle>& triangles, const SurfaceSample& sample) {
  Vec3d p;
  for (std::size_t k = 0; k < 3; ++k)
    p = p + to_double(mesh.positions[mesh.wedge_position[triangles[sample.triangle][k]]]) * sample.weight[k];
  return p;
}

std::uint32_t heaviest_corner(const Mesh& mesh, const SurfaceSample& sample) {
  const auto k = std::max_element(std::begin(sample.weight), std::end(sample.weight)) - sample.weight;
  return mesh.position_of(sample.triangle, static_cast<int>(k));
}

std::vector<double> component_diagonals(const std::vector<std::uint32_t>& component, const Mesh& mesh) {
  std::vector<double> diagonals;
  for (const Box3f& box : component_boxes(component, mesh.positions))
    diagonals.push_back(to_double(box).diagonal());
  return diagonals;
}

class ErrorMeter {
 public:
  ErrorMeter(const std::vector<std::uint32_t>& component, const NestedScales& scales,
             const RunContext& context)
      : component_(component),
        mesh_(scales.mesh),
        collapses_(scales.collapses),
        context_(context),
        original_(mesh_.positions, mesh_.wedge_position, mesh_.triangles),
        diagonal_(component_diagonals(component, mesh_)) {
    for (const SurfaceSample& s : sample_surface(mesh_.positions, mesh_.wedge_position, mesh_.triangles,
                                                 enough_samples(mesh_.triangles.size(), kErrorSamples))) {
      const std::uint32_t corner = heaviest_corner(mesh_, s);
      surface_.push_back({place(mesh_, mesh_.triangles, s), component[corner], corner});
    }
    // Vertices of S_0 are where it deviates most from a coarser scale.
    for (std::uint32_t p = 0; p < mesh_.positions.size();
         p += static_cast<std::uint32_t>(mesh_.positions.size() / kErrorSamples + 1))
      vertices_.push_back({to_double(mesh_.positions[p]), component[p], p});
  }

  void measure(NestedScale& scale) const {
    const SurfaceDistance coarse(mesh_.positions, mesh_.wedge_position, scale.triangles);
    const std::vector<std::uint32_t> survivor =
        survivors(mesh_.positions.size(), collapses_, scale.collapse_count);
    const ScaleWalk walk(mesh_, scale.triangles, survivor, coarse);
    std::vector<double> limit = diagonal_;  // of a component's distance: no limit where it is still there
    for (const Triangle& t : scale.triangles)
      limit[component_[mesh_.wedge_position[t[0]]]] = std::numeric_limits<double>::infinity();
    const auto there = distances(surface_.size(), [&](std::size_t i, Hint&) {
      Hint hint = walk.from(surface_[i].position, surface_[i].point).hint;
      return coarse(surface_[i].point, hint);
    });
    const std::vector<SurfaceSample> samples =
        sample_surface(mesh_.positions, mesh_.wedge_position, scale.triangles,
                       enough_samples(scale.triangles.size(), kErrorSamples));
    const auto back = distances(samples.size(), [&](std::size_t i, Hint& last) {
      const Vec3d p = place(mesh_, scale.triangles, samples[i]);
      last = original_.nearer(original_.hint_of(scale.triangle_source[samples[i].triangle]), last, p);
      return original_(p, last);
    });
    double square = 0, largest = 0, deviation = 0;  // only the deviation has the limits
    for (const auto* side : {&there, &back})
      for (double d : *side) square += d * d, largest = std::max(largest, d);
    for (double d : back) deviation = std::max(deviation, d);
    for (std::size_t i = 0; i < there.size(); ++i)
      deviation = std::max(deviation, std::min(there[i], limit[surface_[i].component]));
    const auto count = static_cast<double>(std::max<std::size_t>(there.size() + back.size(), 1));
    scale.error_rms = static_cast<float>(std::sqrt(square / count));
    // A distance within the deviation so far changes neither number, so a bound of that distance is enough.
    const auto far = distances(vertices_.size(), [&](std::size_t i, Hint&) {
      const double most = std::sqrt(walk.from(vertices_[i].position, vertices_[i].point).distance2);
      return most <= deviation ? most : coarse(vertices_[i].point, deviation);
    });
    for (std::size_t i = 0; i < far.size(); ++i) {
      largest = std::max(largest, far[i]);
      deviation = std::max(deviation, std::min(far[i], limit[vertices_[i].component]));
    }
    scale.error_max = static_cast<float>(largest);
    scale.deviation = static_cast<float>(deviation);
  }

 private:
  /// `distance` takes the index and what the one before has left as a hint.
  template <class Distance>
  std::vector<double> distances(std::size_t count, Distance&& distance) const {
    std::vector<double> out(count);
    parallel_for(context_, (count + kHintChain - 1) / kHintChain, 4, [&](std::size_t begin, std::size_t end) {
      Hint hint;
      for (std::size_t i = begin * kHintChain; i < std::min(end * kHintChain, count); ++i) {
        if (i % kHintChain == 0) hint = {};
        out[i] = distance(i, hint);
      }
    });
    return out;
  }

  const std::vector<std::uint32_t>& component_;
  const Mesh& mesh_;
  const std::vector<Collapse>& collapses_;
  const RunContext& context_;
  SurfaceDistance original_;
  std::vector<double> diagonal_;
  std::vector<Probe> surface_, vertices_;
};

}  // namespace

void measure_scale_errors(const std::vector<std::uint32_t>& component, NestedScales& scales,
                          const RunContext& context) {
  const std::size_t count = scales.scales.size();
  if (count < 2) return;
  const ErrorMeter meter(component, scales, context);
  for (std::size_t i = 1; i < count; ++i) {
    meter.measure(scales.scales[i]);
    context.report(0.7 + 0.3 * static_cast<double>(i) / static_cast<double>(count));
  }
}

}  // namespace texmesh
