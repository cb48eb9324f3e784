#include "format/base/portable_math.h"
#include "format/model/add_wedge.h"
#include "stages/base/parallel.h"
#include "stages/geometry/distance.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/simplification/collapse_engine.h"

namespace texmesh {
namespace {

// A scale that was stopped before its target is left out when it has more than this share of the next finer's
// triangles.
constexpr double kRepeatedShare = 0.97;

constexpr double kCoarsestShare = 0.05;  // of the vertices: coarsest_vertices asks for no more

// Where a scale has less than this share of the next finer one's vertices, the map falls too fast: packages
// have steps of about 2x in triangles between their scales, and there would be none to choose from.
constexpr double kLeastShare = 0.25, kGentleShare = 0.5;

/// Where next to nothing persists (many small components, dust) the map asks for the last scale's vertices at
/// once: from there on each scale halves them until the map is met, or takes larger steps where too few
/// scales are left to meet the last target.
void soften_falls(std::vector<std::uint32_t>& target) {
  for (std::size_t i = 1; i < target.size(); ++i) {
    if (target[i] >= kLeastShare * target[i - 1]) continue;
    const double steps = static_cast<double>(target.size() - i);
    const double share =
        portable::pow(std::max(target.back(), 1u) / static_cast<double>(target[i - 1]), 1 / steps);
    target[i] =
        std::max(target[i],
                 static_cast<std::uint32_t>(std::floor(std::min(share, kGentleShare) * target[i - 1] + 0.5)));
  }
}

/// #{p >= i} for i = 0..scales, scaled down so that the last is at most the share that the options ask for,
/// but not below coarsest_vertices, and without falls that leave nothing between two scales.
std::vector<std::uint32_t> vertex_targets(const ScaleMap& scale_map, const SimplificationOptions& options) {
  std::vector<std::uint32_t> target(static_cast<std::size_t>(scale_map.scales) + 1, 0);
  for (std::uint8_t p : scale_map.persistence)
    for (std::size_t i = 0; i <= std::min<std::size_t>(p, target.size() - 1); ++i) ++target[i];
  if (options.order == CollapseOrder::kThesis) return target;
  const double least = std::min<double>(options.coarsest_vertices, kCoarsestShare * target[0]);
  const double most = std::max(options.coarsest * target[0], least), last = target.back();
  const double factor = last > most ? portable::pow(most / last, 1.0 / scale_map.scales) : 1;
  double scale = 1;
  for (std::uint32_t& t : target) {
    t = static_cast<std::uint32_t>(std::floor(std::max(t * scale, least) + 0.5));
    scale *= factor;
  }
  soften_falls(target);
  return target;
}

/// Chapters 3 and 7 bound neither the error of a scale nor the shift of its texture.
SimplificationOptions without_bounds_of_thesis(SimplificationOptions options) {
  if (options.order == CollapseOrder::kThesis)
    options.max_error = options.max_shift = std::numeric_limits<double>::max();
  return options;
}

std::string stop_reason(CollapseStop stop, const SimplificationOptions& options) {
  if (stop == CollapseStop::kFewTriangles) return "min_triangles is " + std::to_string(options.min_triangles);
  if (stop == CollapseStop::kTooFar) return "every collapse left exceeds max_error or max_shift";
  return stop == CollapseStop::kLocked ? "no collapse is left that keeps seams, borders and orientation" : "";
}

NestedScale scale_at_this_point(CollapseEngine& engine, int scale, std::string reason) {
  NestedScale s;
  s.scale = scale;
  s.collapse_count = static_cast<std::uint32_t>(engine.collapses().size());
  engine.mesh().snapshot(s.triangles, s.triangle_source);
  s.position_count = engine.mesh().alive_positions();
  s.floor_reason = std::move(reason);
  return s;
}

/// Appends the wedges of relaxed junctions that some scale uses to the mesh and renumbers the scales'
/// triangles.
void append_new_wedges(const CollapseMesh& engine, Mesh& mesh, std::vector<NestedScale>& scales) {
  const auto old_count = static_cast<std::uint32_t>(mesh.wedge_count());
  std::vector<std::uint32_t> index(engine.new_wedges().size(), kNoIndex);
  for (NestedScale& scale : scales)
    for (Triangle& t : scale.triangles)
      for (std::uint32_t& w : t) {
        if (w < old_count) continue;
        std::uint32_t& id = index[w - old_count];
        if (id == kNoIndex) {
          const CollapseMesh::NewWedge& wedge = engine.new_wedges()[w - old_count];
          id = static_cast<std::uint32_t>(mesh.wedge_count());
          add_wedge(mesh, mesh, wedge.source, wedge.position);
        }
        w = id;
      }
}

void note_floor(NestedScales& result, const std::vector<std::uint32_t>& target, const std::string& reason) {
  const NestedScale& last = result.scales.back();
  if (last.position_count <= target.back()) return;
  add_info(result.notes, "scale-floor", "scale " + std::to_string(last.scale),
           "the coarsest scale has " + std::to_string(last.position_count) +
               " vertices where the scale map asks for " + std::to_string(target.back()) + ": " + reason);
}

/// Leaves out trailing scales that deviate by more than max_error, and what only they use.
void drop_far_scales(NestedScales& result, double limit) {
  std::vector<NestedScale>& scales = result.scales;
  while (scales.size() > 1 && scales.back().deviation > limit) scales.pop_back();
  result.collapses.resize(scales.back().collapse_count);
  std::uint32_t last = 0;
  for (const NestedScale& scale : scales)
    for (const Triangle& t : scale.triangles) last = std::max({last, t[0], t[1], t[2]});
  // New wedges stand behind the input's, in the order of the scales that need them first.
  Mesh& m = result.mesh;
  auto cut = [last](auto& values) {
    if (values.size() > last + 1) values.resize(last + 1);
  };
  cut(m.wedge_position), cut(m.uv0), cut(m.uv1), cut(m.normals), cut(m.colours), cut(m.tangents);
}

/// Fills scales, collapses and new wedges; returns the diagonal. What collapses take, twice a large mesh, is
/// gone behind it. `floor`: what stopped the last scale.
double collapse(const ConditionedMesh& mesh, const ScaleMap& scale_map,
                const std::vector<std::uint32_t>& target, const SimplificationOptions& options,
                const RunContext& context, NestedScales& result, std::string& floor) {
  CollapseEngine engine(mesh, scale_map, options, context);
  result.scales.push_back(scale_at_this_point(engine, 0, ""));
  for (std::size_t i = 1; i < target.size(); ++i) {
    floor = stop_reason(engine.run_to(target[i], static_cast<int>(i), context), options);
    const NestedScale& finer = result.scales.back();
    const bool repeated = !floor.empty() && engine.mesh().alive_faces() >
                                                kRepeatedShare * static_cast<double>(finer.triangles.size());
    if (engine.collapses().size() > finer.collapse_count && !repeated)
      result.scales.push_back(scale_at_this_point(engine, static_cast<int>(i), floor));
    context.report(0.7 * (1 - static_cast<double>(engine.mesh().alive_positions()) /
                                  static_cast<double>(mesh.mesh.positions.size())));
  }
  result.collapses = engine.collapses();
  append_new_wedges(engine.mesh(), result.mesh, result.scales);
  return engine.mesh().diagonal();
}

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
      Hint hint = walk.quick_from(surface_[i].position, surface_[i].point).hint;
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
      const auto& [point, component, position] = vertices_[i];
      const double most = std::sqrt(walk.quick_from(position, point).distance2);
      return most <= deviation ? most : coarse(point, deviation);
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
  std::vector<double> distances(std::size_t count, auto&& distance) const {
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

NestedScales simplify(const ConditionedMesh& mesh, const ScaleMap& scale_map,
                      const SimplificationOptions& asked, const RunContext& context) {
  const SimplificationOptions options = without_bounds_of_thesis(asked);
  if (scale_map.persistence.size() != mesh.mesh.positions.size())
    throw StageError("simplification", "scale map", std::to_string(mesh.mesh.positions.size()) + " positions",
                     std::to_string(scale_map.persistence.size()));
  NestedScales result;
  result.mesh = mesh.mesh;
  result.twin = mesh.twin;
  const std::vector<std::uint32_t> target = vertex_targets(scale_map, options);
  std::string floor;
  const double diagonal = collapse(mesh, scale_map, target, options, context, result, floor);
  measure_scale_errors(mesh.component, result, context);
  const std::size_t taken = result.scales.size();
  drop_far_scales(result, options.max_error * diagonal);
  if (result.scales.size() < taken) floor = "every coarser scale exceeds max_error";
  // The last scale may have met its own target before what stopped the next ones.
  if (result.scales.size() > 1 && result.scales.back().floor_reason.empty())
    result.scales.back().floor_reason = floor;
  note_floor(result, target, floor);
  return result;
}

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
