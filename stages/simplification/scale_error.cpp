#include "stages/simplification/scale_error.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "format/base/no_index.h"
#include "stages/base/parallel.h"
#include "stages/geometry/component_boxes.h"
#include "stages/geometry/distance.h"

namespace texmesh {
namespace {

// Per scale and direction: the rms is within 2 % then; the largest distance is that of a sample. Where there
// are few triangles, more points than triangles say little more.
constexpr std::size_t kErrorSamples = 4000, kLeastSamples = 500;

std::size_t sample_count(std::size_t triangles) {
  return std::min(kErrorSamples, std::max(kLeastSamples, triangles));
}

/// A point of S_0 and the component that it lies on.
struct Probe {
  Vec3d point;
  std::uint32_t component;
  std::uint32_t triangle = kNoIndex;  // of S_0
};

using Hint = SurfaceDistance::Hint;

Vec3d place(const Mesh& mesh, const std::vector<Triangle>& triangles, const SurfaceSample& sample) {
  Vec3d p;
  for (std::size_t k = 0; k < 3; ++k)
    p = p + to_double(mesh.positions[mesh.wedge_position[triangles[sample.triangle][k]]]) * sample.weight[k];
  return p;
}

std::vector<double> component_diagonals(const std::vector<std::uint32_t>& component, const Mesh& mesh) {
  std::vector<double> diagonals;
  for (const Box3f& box : component_boxes(component, mesh.positions))
    diagonals.push_back(to_double(box).diagonal());
  return diagonals;
}

class ErrorMeter {
 public:
  ErrorMeter(const std::vector<std::uint32_t>& component, const Mesh& mesh, const RunContext& context)
      : component_(component),
        mesh_(mesh),
        context_(context),
        original_(mesh.positions, mesh.wedge_position, mesh.triangles),
        diagonal_(component_diagonals(component, mesh)) {
    for (const SurfaceSample& s : sample_surface(mesh.positions, mesh.wedge_position, mesh.triangles,
                                                 sample_count(mesh.triangles.size())))
      surface_.push_back(
          {place(mesh, mesh.triangles, s), component[mesh.position_of(s.triangle, 0)], s.triangle});
    // Vertices of S_0 are where it deviates most from a coarser scale.
    for (std::size_t p = 0; p < mesh.positions.size(); p += mesh.positions.size() / kErrorSamples + 1)
      vertices_.push_back({to_double(mesh.positions[p]), component[p]});
  }

  void measure(NestedScale& scale) const {
    const SurfaceDistance coarse(mesh_.positions, mesh_.wedge_position, scale.triangles);
    std::vector<double> limit = diagonal_;  // of a component's distance: no limit where it is still there
    for (const Triangle& t : scale.triangles)
      limit[component_[mesh_.wedge_position[t[0]]]] = std::numeric_limits<double>::infinity();
    // A search is several times shorter from the triangle that a point's own one comes from, or becomes.
    std::vector<Hint> becomes(mesh_.triangles.size());
    for (std::uint32_t t = 0; t < scale.triangles.size(); ++t)
      becomes[scale.triangle_source[t]] = coarse.hint_of(t);
    const auto there = distances(surface_.size(), [&](std::size_t i) {
      Hint hint = becomes[surface_[i].triangle];
      return coarse(surface_[i].point, hint);
    });
    const std::vector<SurfaceSample> samples = sample_surface(
        mesh_.positions, mesh_.wedge_position, scale.triangles, sample_count(scale.triangles.size()));
    const auto back = distances(samples.size(), [&](std::size_t i) {
      Hint hint = original_.hint_of(scale.triangle_source[samples[i].triangle]);
      return original_(place(mesh_, scale.triangles, samples[i]), hint);
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
    const auto far =
        distances(vertices_.size(), [&](std::size_t i) { return coarse(vertices_[i].point, deviation); });
    for (std::size_t i = 0; i < far.size(); ++i) {
      largest = std::max(largest, far[i]);
      deviation = std::max(deviation, std::min(far[i], limit[vertices_[i].component]));
    }
    scale.error_max = static_cast<float>(largest);
    scale.deviation = static_cast<float>(deviation);
  }

 private:
  template <class Distance>
  std::vector<double> distances(std::size_t count, Distance&& distance) const {
    std::vector<double> out(count);
    parallel_for(context_, count, 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) out[i] = distance(i);
    });
    return out;
  }

  const std::vector<std::uint32_t>& component_;
  const Mesh& mesh_;
  const RunContext& context_;
  SurfaceDistance original_;
  std::vector<double> diagonal_;
  std::vector<Probe> surface_, vertices_;
};

}  // namespace

void measure_scale_errors(const std::vector<std::uint32_t>& component, const Mesh& mesh,
                          std::vector<NestedScale>& scales, const RunContext& context) {
  if (scales.size() < 2) return;
  const ErrorMeter meter(component, mesh, context);
  for (std::size_t i = 1; i < scales.size(); ++i) {
    meter.measure(scales[i]);
    context.report(0.7 + 0.3 * static_cast<double>(i) / static_cast<double>(scales.size()));
  }
}

}  // namespace texmesh
