#include "tools/inspect/debug/debug_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "format/base/no_index.h"
#include "format/base/portable_math.h"
#include "format/base/srgb.h"
#include "pipeline/io/text_table.h"
#include "stages/geometry/component_boxes.h"
#include "stages/ssf/ssf.h"

namespace texmesh {
namespace {

/// Nine colours of the widely used "viridis" scale, eighths apart.
constexpr std::array<Srgb, 9> kScale{{{68, 1, 84},
                                      {71, 44, 122},
                                      {59, 81, 139},
                                      {44, 113, 142},
                                      {33, 144, 141},
                                      {39, 173, 129},
                                      {92, 200, 99},
                                      {170, 220, 50},
                                      {253, 231, 37}}};
constexpr int kStops = 5;

Vec4f linear_colour(Srgb c) {
  Vec4f out{0, 0, 0, 1};
  for (std::size_t k = 0; k < 3; ++k) {
    const double s = c[k] / 255.0;
    const double x = light_of_srgb(s);
    (k == 0 ? out.x : k == 1 ? out.y : out.z) = static_cast<float>(x);
  }
  return out;
}

double fraction_of(const DebugLegend& legend, double value) {
  double lo = legend.lo, hi = legend.hi;
  if (legend.logarithmic) lo = portable::log(lo), hi = portable::log(hi), value = portable::log(value);
  return hi > lo ? std::clamp((value - lo) / (hi - lo), 0.0, 1.0) : 0;
}

void add_stops(DebugLegend& legend) {
  for (int k = 0; k < kStops; ++k) {
    const double f = static_cast<double>(k) / (kStops - 1);
    const double value = legend.logarithmic
                             ? portable::exp(portable::log(legend.lo) +
                                             f * (portable::log(legend.hi) - portable::log(legend.lo)))
                             : legend.lo + f * (legend.hi - legend.lo);
    legend.stops.emplace_back(value, colour_of(f));
  }
}

/// The mesh alone, one matt material, colours from a value per position.
DebugView coloured(const Mesh& source, const std::vector<double>& value, DebugLegend legend) {
  DebugView view;
  view.mesh = source;
  view.mesh.uv0.clear(), view.mesh.uv1.clear();
  view.mesh.triangle_material.assign(source.triangles.size(), 0);
  view.materials.resize(1);
  view.materials[0].double_sided = true;
  view.materials[0].metallic = 0;
  add_stops(legend);
  view.mesh.colours.resize(source.wedge_count());
  for (std::size_t w = 0; w < source.wedge_count(); ++w)
    view.mesh.colours[w] = linear_colour(colour_of(fraction_of(legend, value[source.wedge_position[w]])));
  view.legend = std::move(legend);
  return view;
}

double rank(std::vector<double> values, double fraction) {
  if (values.empty()) return 0;
  const auto at = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

void require_same(std::size_t positions, std::size_t values, const char* what) {
  if (positions != values)
    throw StageError("debug", what, std::to_string(positions) + " positions", std::to_string(values));
}

std::string share(double count, double of) { return fixed(of > 0 ? 100 * count / of : 0, 1) + " %"; }

/// Neighbours along the edges, [first[p], first[p + 1]) of `list`; with repetitions.
struct Neighbours {
  std::vector<std::uint32_t> first, list;
  explicit Neighbours(const Mesh& m) : first(m.positions.size() + 1, 0), list(6 * m.triangles.size()) {
    for (std::uint32_t t = 0; t < m.triangles.size(); ++t)
      for (int k = 0; k < 3; ++k) first[m.position_of(t, k) + 1] += 2;
    for (std::size_t p = 0; p < m.positions.size(); ++p) first[p + 1] += first[p];
    std::vector<std::uint32_t> at(first.begin(), first.end() - 1);
    for (std::uint32_t t = 0; t < m.triangles.size(); ++t)
      for (int k = 0; k < 3; ++k)
        for (int other = 1; other < 3; ++other)
          list[at[m.position_of(t, k)]++] = m.position_of(t, (k + other) % 3);
  }
};

/// A feature of a large scale is one vertex for all that are nearer than the distance that features of that
/// scale keep; on a dense mesh a line of them would be specks. Each is painted half as large: they touch.
std::vector<double> spread_features(const ConditionedMesh& mesh, const ScaleMap& map) {
  const Mesh& m = mesh.mesh;
  const Neighbours neighbours(m);
  const std::vector<Box3f> boxes = component_boxes(mesh.component, m.positions);
  const SsfOptions usual;
  std::vector<double> value(map.persistence.begin(), map.persistence.end());
  std::vector<std::uint32_t> seen_from(value.size(), kNoIndex), near;
  for (std::uint32_t feature = 0; feature < value.size(); ++feature) {
    const std::uint8_t scale = map.persistence[feature];
    const double diagonal = to_double(boxes[mesh.component[feature]]).diagonal();
    const double sigma = std::min<double>(map.sigma.at(scale), usual.sigma_max * diagonal);
    const double reach = 0.5 * feature_spacing(sigma, usual);
    near.assign(1, feature);
    seen_from[feature] = feature;
    for (std::size_t i = 0; i < near.size(); ++i)
      for (std::uint32_t k = neighbours.first[near[i]]; k < neighbours.first[near[i] + 1]; ++k) {
        const std::uint32_t p = neighbours.list[k];
        if (seen_from[p] == feature ||
            length(to_double(m.positions[p]) - to_double(m.positions[feature])) > reach)
          continue;
        seen_from[p] = feature;
        value[p] = std::max<double>(value[p], scale);
        near.push_back(p);
      }
  }
  return value;
}

/// R's remarks: how the skeleton came about, in the notes' own words.
void add_remarks(const Notes& notes, DebugLegend& legend) {
  for (const Note& n : notes) legend.remarks.push_back(n.code + ": " + n.text);
}

}  // namespace

Srgb colour_of(double fraction) {
  const double at = std::clamp(fraction, 0.0, 1.0) * (kScale.size() - 1);
  const auto low = std::min(static_cast<std::size_t>(at), kScale.size() - 2);
  Srgb out{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double x = kScale[low][k] + (at - static_cast<double>(low)) * (kScale[low + 1][k] - kScale[low][k]);
    out[k] = static_cast<std::uint8_t>(x + 0.5);
  }
  return out;
}

DebugView view_persistence(const ConditionedMesh& mesh, const ScaleMap& scale_map) {
  require_same(mesh.mesh.positions.size(), scale_map.persistence.size(), "scale map");
  DebugLegend legend{"persistence: highest scale at which a vertex is still a feature",
                     "",
                     0,
                     static_cast<double>(scale_map.scales),
                     false,
                     true,
                     {},
                     {}};
  for (const double share_of : {0.5, 1.0}) {
    const int scale = std::max(1, static_cast<int>(share_of * scale_map.scales));
    const auto count = std::count_if(scale_map.persistence.begin(), scale_map.persistence.end(),
                                     [&](int p) { return p >= scale; });
    legend.remarks.push_back(fmt::format(
        "{} of the vertices persist to scale {} or beyond (sigma {})",
        share(static_cast<double>(count), static_cast<double>(scale_map.persistence.size())), scale,
        shortest(static_cast<double>(scale_map.sigma.at(static_cast<std::size_t>(scale))))));
  }
  legend.remarks.push_back("features of a scale keep a distance; each is painted to the half of it");
  return coloured(mesh.mesh, spread_features(mesh, scale_map), std::move(legend));
}

DebugView view_radius(const ConditionedMesh& mesh, const Skeleton& skeleton) {
  require_same(mesh.mesh.positions.size(), skeleton.radius.size(), "skeleton");
  const std::vector<double> value(skeleton.radius.begin(), skeleton.radius.end());
  DebugLegend legend{"R: distance to the skeleton with its floor, as perceptual values divide by it",
                     "object units",
                     rank(value, 0.01),
                     rank(value, 0.99),
                     false,
                     true,
                     {},
                     {}};
  legend.remarks.push_back("colours run from the 1st to the 99th percentile; median " +
                           shortest(rank(value, 0.5)));
  std::size_t floored = 0;
  for (std::size_t p = 0; p < value.size(); ++p) floored += skeleton.radius[p] > skeleton.distance[p];
  legend.remarks.push_back(share(static_cast<double>(floored), static_cast<double>(value.size())) +
                           " of the vertices have the floor");
  add_remarks(skeleton.notes, legend);
  return coloured(mesh.mesh, value, std::move(legend));
}

DebugView view_skeleton(const ConditionedMesh& mesh, const Skeleton& skeleton) {
  DebugView view = coloured(mesh.mesh, std::vector<double>(mesh.mesh.positions.size(), 0), {});
  for (Vec4f& c : view.mesh.colours) c = {0.55f, 0.55f, 0.55f, 0.35f};
  view.translucent = true;
  view.nodes = skeleton.nodes;
  view.lines = skeleton.segments;
  view.legend = {"curve skeleton: red lines through the translucent surface", "", 0, 0, false, false, {}, {}};
  view.legend.remarks.push_back(
      fmt::format("{} nodes, {} segments", skeleton.nodes.size(), skeleton.segments.size()));
  add_remarks(skeleton.notes, view.legend);
  return view;
}

DebugView view_collapse_error(const NestedScales& scales) {
  const Mesh& mesh = scales.mesh;
  constexpr double kNever = -1;
  std::vector<double> value(mesh.positions.size(), kNever), removed;
  for (const Collapse& c : scales.collapses) {
    value.at(c.from) = static_cast<double>(c.error);
    if (c.error > 0) removed.push_back(value[c.from]);
  }
  const double hi = removed.empty() ? 1 : *std::max_element(removed.begin(), removed.end());
  const double lo = removed.empty() ? hi : std::max(rank(removed, 0.01), hi * 1e-6);
  DebugLegend legend{"collapse error: quadric error at which a vertex was removed",
                     "object units",
                     std::min(lo, hi),
                     hi,
                     true,
                     true,
                     {},
                     {}};
  std::size_t kept = 0;
  for (double& v : value) {
    kept += v == kNever;
    v = v == kNever ? hi : std::max(v, legend.lo);
  }
  legend.remarks.push_back(fmt::format(
      "{} collapses; {} of the vertices are left in the coarsest scale and "
      "have the highest colour",
      scales.collapses.size(), share(static_cast<double>(kept), static_cast<double>(value.size()))));
  for (const NestedScale& s : scales.scales)
    if (!s.floor_reason.empty()) {
      legend.remarks.push_back(fmt::format("S_{}: {}", s.scale, s.floor_reason));
      break;
    }
  return coloured(mesh, value, std::move(legend));
}

}  // namespace texmesh
