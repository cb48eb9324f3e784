#include "format/base/buckets.h"
#include "stages/base/parallel.h"
#include "stages/geometry/morton.h"
#include "stages/ssf/heat_kernel.h"
#include "stages/ssf/ssf_component.h"

namespace texmesh {
namespace {

/// Components below this many vertices are solved whole by one thread each, many at a time.
constexpr std::size_t kSmallComponent = 8192;

/// Positions (lowest twins alone) and triangles, grouped by component: items of component c are [first[c],
/// first[c + 1]).
struct Layout {
  std::vector<std::uint32_t> position, first_position;  // within a component in Morton order
  std::vector<std::uint32_t> triangle, first_triangle;
  std::vector<std::uint32_t> vertex;  // per lowest twin: its index within the component
  std::vector<Box3d> box;             // per component, object units
  std::vector<double> mean_edge;      // per component, object units
  std::size_t component_count() const { return box.size(); }
  std::size_t size(std::size_t c) const { return first_position[c + 1] - first_position[c]; }
};

/// Places of positions along a Morton curve: neighbours in space are neighbours in memory.
class MortonCode {
 public:
  explicit MortonCode(const std::vector<Vec3f>& positions) {
    const Box3d box = to_double(bounding_box(positions));
    lo_ = box.min;
    side_ = std::max(box.longest_side(), 1e-300);
  }
  std::uint64_t operator()(Vec3f p) const {
    std::uint64_t bits = 0;
    for (int k = 0; k < 3; ++k)
      bits |= spread_bits(static_cast<std::uint64_t>((double{p[k]} - lo_[k]) / side_ * 0x1fffff)) << k;
    return bits;
  }

 private:
  Vec3d lo_;
  double side_ = 0;
};

void group_positions(const ConditionedMesh& mesh, Layout& layout) {
  const auto& positions = mesh.mesh.positions;
  const MortonCode code(positions);
  using Coded = std::pair<std::uint64_t, std::uint32_t>;
  Buckets<Coded> coded = in_buckets<Coded>(mesh.component_count, [&](auto&& put) {
    for (std::uint32_t p = 0; p < positions.size(); ++p)
      if (mesh.twin[p] == p) put(mesh.component[p], {code(positions[p]), p});
  });
  layout.first_position = coded.first;
  layout.position.resize(coded.items.size());
  layout.vertex.assign(positions.size(), 0);
  for (std::size_t c = 0; c < mesh.component_count; ++c) {
    std::ranges::sort(coded[c]);
    for (std::uint32_t i = coded.first[c]; i < coded.first[c + 1]; ++i) {
      layout.position[i] = coded.items[i].second;
      layout.vertex[coded.items[i].second] = i - coded.first[c];
    }
  }
}

void group_triangles(const ConditionedMesh& mesh, Layout& layout) {
  const Mesh& m = mesh.mesh;
  Buckets<std::uint32_t> triangles = in_buckets(mesh.component_count, [&](auto&& put) {
    for (std::uint32_t t = 0; t < m.triangles.size(); ++t) put(mesh.component[m.position_of(t, 0)], t);
  });
  layout.first_triangle = std::move(triangles.first);
  layout.triangle = std::move(triangles.items);
}

void measure(const Mesh& m, Layout& layout) {
  for (std::size_t c = 0; c + 1 < layout.first_position.size(); ++c) {
    Box3f box;
    for (std::uint32_t i = layout.first_position[c]; i < layout.first_position[c + 1]; ++i)
      box.extend(m.positions[layout.position[i]]);
    double sum = 0;
    for (std::uint32_t i = layout.first_triangle[c]; i < layout.first_triangle[c + 1]; ++i)
      for (int k = 0; k < 3; ++k)
        sum += length(to_double(m.positions[m.position_of(layout.triangle[i], k)]) -
                      to_double(m.positions[m.position_of(layout.triangle[i], (k + 1) % 3)]));
    layout.box.push_back(to_double(box));
    layout.mean_edge.push_back(sum / (3.0 * (layout.first_triangle[c + 1] - layout.first_triangle[c])));
  }
}

Layout make_layout(const ConditionedMesh& mesh) {
  Layout layout;
  group_positions(mesh, layout);
  group_triangles(mesh, layout);
  measure(mesh.mesh, layout);
  return layout;
}

/// `radius`: R(v) of the mesh's positions, empty where curvature is the signal.
SurfaceComponent cut_out(const ConditionedMesh& mesh, const Layout& layout, std::size_t c,
                         const std::vector<float>& radius) {
  const Mesh& m = mesh.mesh;
  SurfaceComponent out;
  out.mean_edge = layout.mean_edge[c];
  out.diagonal = layout.box[c].diagonal();
  const std::uint32_t* position = layout.position.data() + layout.first_position[c];
  const Box3d& box = layout.box[c];
  const Vec3d centre = box.centre();
  double largest = 0;
  for (int k = 0; k < 3; ++k) largest = std::max({largest, std::fabs(box.min[k]), std::fabs(box.max[k])});
  out.points.reserve(layout.size(c));
  for (std::size_t v = 0; v < layout.size(c); ++v)
    out.points.push_back((to_double(m.positions[position[v]]) - centre) * (1 / out.mean_edge));
  for (std::size_t v = 0; v < layout.size(c) && !radius.empty(); ++v)
    out.radius.push_back(static_cast<double>(radius[position[v]]) / out.mean_edge);
  out.noise = largest * 0x1p-24 / out.mean_edge;
  const std::size_t triangles = layout.first_triangle[c + 1] - layout.first_triangle[c];
  out.corners.reserve(3 * triangles);
  out.fan_of_position.reserve(3 * triangles);
  for (std::uint32_t i = layout.first_triangle[c]; i < layout.first_triangle[c + 1]; ++i)
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t p = m.position_of(layout.triangle[i], k);
      out.corners.push_back(layout.vertex[mesh.twin[p]]);
      out.fan_of_position.push_back(mesh.twin[p] == p);
    }
  return out;
}

/// What the notes tell, over all components.
struct Totals {
  std::size_t slowed = 0, clustered = 0;
  void add(const ComponentScales& s) {
    slowed += s.slowed;
    clustered += s.clustered;
  }
};

class MeshFilter {
 public:
  MeshFilter(const ConditionedMesh& mesh, const std::vector<float>& radius, const SsfOptions& options,
             const RunContext& context)
      : mesh_(mesh), radius_(radius), options_(options), context_(context), layout_(make_layout(mesh)) {
    const auto entries = static_cast<std::size_t>(options.scales) + 1;
    map_.scales = options.scales;
    map_.sigma.assign(entries, 0);
    map_.convergence.assign(entries, 1);
    map_.crossings_at.assign(entries, 0);
    map_.crossings_at[0] = static_cast<std::uint32_t>(mesh.mesh.positions.size());
    map_.persistence.assign(mesh.mesh.positions.size(), 0);
    map_.crossing.assign(mesh.mesh.positions.size(), 0);
  }

  ScaleMap run() {
    const std::size_t largest = largest_component();
    if (!is_below_first_scale(largest)) {
      filter_largest(largest);
      filter_others(largest);
    }
    for (std::size_t p = 0; p < map_.persistence.size(); ++p) {
      map_.persistence[p] = map_.persistence[mesh_.twin[p]];
      map_.crossing[p] = map_.crossing[mesh_.twin[p]];
    }
    describe();
    context_.report(1);
    return std::move(map_);
  }

 private:
  bool is_below_first_scale(std::size_t c) const {
    return below_first_scale(layout_.box[c].diagonal(), layout_.mean_edge[c], options_);
  }

  std::size_t largest_component() const {
    const auto rank = [&](std::size_t c) { return std::pair(!is_below_first_scale(c), layout_.size(c)); };
    std::size_t best = 0;
    for (std::size_t c = 1; c < layout_.component_count(); ++c)
      if (rank(c) > rank(best)) best = c;
    return best;
  }

  void filter_largest(std::size_t c) {
    const ComponentScales s = filter_component(cut_out(mesh_, layout_, c, radius_), {}, options_, context_);
    whole_sigma_ = s.sigma;
    std::copy(s.sigma.begin(), s.sigma.end(), map_.sigma.begin() + 1);
    map_.convergence = s.convergence;
    totals_.add(s);
    place(c, s);
    count(s);
  }

  void filter_others(std::size_t largest) {
    std::vector<std::uint32_t> small;
    for (std::uint32_t c = 0; c < layout_.component_count(); ++c) {
      if (c == largest || is_below_first_scale(c)) continue;
      if (layout_.size(c) < kSmallComponent) {
        small.push_back(c);
        continue;
      }
      const ComponentScales s =
          filter_component(cut_out(mesh_, layout_, c, radius_), whole_sigma_, options_, context_);
      totals_.add(s);
      place(c, s);
      count(s);
    }
    filter_small(small);
  }

  /// In batches, so that counts need not be kept per component.
  void filter_small(const std::vector<std::uint32_t>& small) {
    constexpr std::size_t kBatch = 4096;
    RunContext alone = context_;
    alone.threads = 1;
    alone.progress = nullptr;
    for (std::size_t batch = 0; batch < small.size(); batch += kBatch) {
      std::vector<ComponentScales> done(std::min(kBatch, small.size() - batch));
      parallel_each(context_, done.size(), 1, [&](std::size_t i) {
        done[i] = filter_component(cut_out(mesh_, layout_, small[batch + i], radius_), whole_sigma_, options_,
                                   alone);
        place(small[batch + i], done[i]);
        done[i].persistence = done[i].crossing = {};
      });
      for (const ComponentScales& s : done) {
        totals_.add(s);
        count(s);
      }
    }
  }

  void place(std::size_t c, const ComponentScales& s) {
    for (std::size_t v = 0; v < s.persistence.size(); ++v) {
      const std::uint32_t p = layout_.position[layout_.first_position[c] + v];
      map_.persistence[p] = s.persistence[v];
      map_.crossing[p] = s.crossing[v];
    }
  }

  void count(const ComponentScales& s) {
    for (std::size_t i = 1; i < s.crossings_at.size(); ++i) map_.crossings_at[i] += s.crossings_at[i];
  }

  void describe() {
    if (totals_.slowed)
      add_info(map_.notes, "scale-space-work-cap", "",
               "heat flow on " + std::to_string(totals_.slowed) +
                   " component(s) slowed down where it is fastest, to fit max_terms");
    if (totals_.clustered)
      add_info(map_.notes, "scale-space-clusters", "",
               std::to_string(totals_.clustered) +
                   " component(s) sampled so unevenly that positions closer than half a mean edge share one "
                   "feature point");
  }

  const ConditionedMesh& mesh_;
  const std::vector<float>& radius_;
  const SsfOptions& options_;
  const RunContext& context_;
  Layout layout_;
  std::vector<double> whole_sigma_;  // of the largest component
  ScaleMap map_;
  Totals totals_;
};

}  // namespace

SurfaceComponent largest_surface(const ConditionedMesh& mesh) {
  const Layout layout = make_layout(mesh);
  std::size_t best = 0;
  for (std::size_t c = 1; c < layout.component_count(); ++c)
    if (layout.size(c) > layout.size(best)) best = c;
  return cut_out(mesh, layout, best, {});
}

double feature_spacing(double sigma, const SsfOptions& options) {
  return seed_radius(sigma, options.error_ratio);
}

ScaleMap filter_scale_space(const ConditionedMesh& mesh, const SsfOptions& options,
                            const RunContext& context) {
  const std::vector<float> by_curvature;
  return MeshFilter(mesh, by_curvature, options, context).run();
}

ScaleMap filter_skeleton_distance(const ConditionedMesh& mesh, const Skeleton& skeleton,
                                  const SsfOptions& options, const RunContext& context) {
  if (skeleton.distance.size() != mesh.mesh.positions.size())
    throw StageError("ssf", "skeleton", std::to_string(mesh.mesh.positions.size()) + " positions",
                     std::to_string(skeleton.distance.size()));
  return MeshFilter(mesh, skeleton.distance, options, context).run();
}

}  // namespace texmesh
