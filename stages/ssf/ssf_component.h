#pragma once
#include <span>

#include "stages/base/run_context.h"
#include "stages/ssf/ssf.h"

namespace texmesh {

/// One connected component with its twins joined: the surface as heat sees it. Neighbours in space should be
/// neighbours in memory.
struct SurfaceComponent {
  std::vector<Vec3d> points;           // centred, in units of the mean edge
  std::vector<std::uint32_t> corners;  // three vertices per triangle
  // Per corner: whether its triangle belongs to the vertex's own position, and not to a twin's.
  std::vector<bool> fan_of_position;
  double mean_edge = 0, diagonal = 0;  // object units
  double noise = 0;                    // rounding of the stored coordinates, in units of the mean edge
  std::vector<double> radius;          // R(v) in units of the mean edge; empty: filtered by curvature
};

/// The component of most positions, cut out of a mesh along a Morton curve.
SurfaceComponent largest_surface(const ConditionedMesh& mesh);

/// Feature points of one component, scale by scale.
struct ComponentScales {
  std::vector<std::uint8_t> persistence, crossing;  // per vertex, as in ScaleMap
  std::vector<std::uint32_t> crossings_at;          // [scales + 1]; [0] stays 0
  std::vector<float> convergence;                   // [scales + 1]
  std::vector<double> sigma;                        // [scales], object units
  bool clustered = false;                           // finest scales on clusters of half a mean edge
  bool slowed = false;                              // by the work cap
  double capped = 0;                                // fraction of edges with a capped rate, finest level
};

/// Smaller than its first scale: all of it is detail, none of it a feature.
bool below_first_scale(double diagonal, double mean_edge, const SsfOptions& options);

/// The sigmas of a component's scales and then of the subtrahends that its largest ones need, in mean edges:
/// geometric from 1 to `sigma_max` at the last scale. The band ratio is rounded to whole steps, so that the
/// subtrahends are scales of the ladder too.
struct SigmaLadder {
  std::vector<double> sigma, time;  // [scales + band]; time = sigma^2 / 2
  std::size_t band = 0;             // C_i = t_i (H(sigma_i) - H(sigma_{i + band}))
};
SigmaLadder make_sigma_ladder(double sigma_max, const SsfOptions& options);

/// Scale-space filtering of one component that is not below its first scale. Heat flows up a pyramid of
/// levels, each as coarse as the scales that it carries allow; a scale's feature points lie on its level's
/// vertices. `whole_sigma`: the sigmas of the largest component's scales (object units, rising), which end
/// persistence where they exceed component_cap of this one; empty for the largest itself. Deterministic for
/// any thread count.
ComponentScales filter_component(SurfaceComponent component, std::span<const double> whole_sigma,
                                 const SsfOptions& options, const RunContext& context);

}  // namespace texmesh
