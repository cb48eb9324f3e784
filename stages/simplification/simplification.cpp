
#include <algorithm>
#include <limits>

#include "format/base/portable_math.h"
#include "stages/simplification/collapse_engine.h"
#include "stages/simplification/scale_error.h"

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
  switch (stop) {
    case CollapseStop::kReached:
      return "";
    case CollapseStop::kFewTriangles:
      return "min_triangles is " + std::to_string(options.min_triangles);
    case CollapseStop::kTooFar:
      return "every collapse left exceeds max_error or max_shift";
    case CollapseStop::kLocked:
      return "no collapse is left that keeps seams, borders and orientation";
  }
  return "";
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
          mesh.wedge_position.push_back(wedge.position);
          auto repeat = [&](auto& values) {
            if (!values.empty()) {
              const auto value = values[wedge.source];
              values.push_back(value);
            };
          };
          repeat(mesh.uv0), repeat(mesh.uv1), repeat(mesh.normals), repeat(mesh.colours),
              repeat(mesh.tangents);
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

}  // namespace texmesh
