// How charts grow. Each triangle is a chart at first. ChartMerge takes the pair of neighbours that would be
// flattest and roundest, and joins it when ChartLayout finds places in a plane for it: by projection, else by
// conformal_map(). A pair that was refused is tried again when it has grown. It ends when no pair is left.
#include <Eigen/SparseCholesky>
#include <complex>
#include <numeric>

#include "format/base/portable_math.h"
#include "stages/charts/chart_parts.h"
#include "stages/charts/charts.h"
#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

using Complex = std::complex<double>;

/// Whatever the map, sum over corners of weight times place is 0 where the triangle keeps its angles.
std::array<Complex, 3> corner_weights(const OwnPlane& own) {
  const Complex a = 0, b = own.base, c(own.apex.x, own.apex.y);
  const double scale = 1 / std::sqrt(2 * own.area());
  return {(c - b) * scale, (a - c) * scale, (b - a) * scale};
}

/// Least-squares conformal map of a disk (Levy et al. 2002). `triangles`: indices of vertices, all of which
/// are in use; `own`: the same triangles in their own planes; two vertices far from each other are pinned at
/// `distance`. Returns a place per vertex; empty when the equations have no solution.
std::vector<Vec2d> conformal_map(std::span<const Triangle> triangles, std::span<const OwnPlane> own,
                                 std::size_t vertex_count, std::array<std::uint32_t, 2> pinned,
                                 double distance) {
  const auto free_count = static_cast<int>(vertex_count) - 2;
  std::vector<int> column(vertex_count, -1);
  for (int i = 0, next = 0; i < static_cast<int>(vertex_count); ++i)
    if (static_cast<std::uint32_t>(i) != pinned[0] && static_cast<std::uint32_t>(i) != pinned[1])
      column[static_cast<std::size_t>(i)] = next++;
  std::vector<Eigen::Triplet<Complex>> entries;
  Eigen::VectorXcd right = Eigen::VectorXcd::Zero(free_count);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const std::array<Complex, 3> w = corner_weights(own[t]);
    for (std::size_t i = 0; i < 3; ++i) {
      const int row = column[triangles[t][i]];
      if (row < 0) continue;
      for (std::size_t j = 0; j < 3; ++j) {
        const Complex product = std::conj(w[i]) * w[j];
        if (const int at = column[triangles[t][j]]; at >= 0)
          entries.emplace_back(row, at, product);
        else if (triangles[t][j] == pinned[1])
          right[row] -= product * distance;
      }
    }
  }
  Eigen::SparseMatrix<Complex> matrix(free_count, free_count);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<Complex>> solver(matrix);
  if (solver.info() != Eigen::Success) return {};
  const Eigen::VectorXcd solution = solver.solve(right);
  std::vector<Vec2d> places(vertex_count);
  for (std::size_t v = 0; v < vertex_count; ++v)
    if (column[v] >= 0) places[v] = {solution[column[v]].real(), solution[column[v]].imag()};
  places[pinned[1]] = {distance, 0};
  return places;
}

// A projection that stretches no more than this is kept: the solver would hardly make it better.
constexpr double kProjectionStretch = 1.02;

/// Lays disks of triangles into planes, and keeps the places of charts. A chart's area in
/// its plane is its area on the surface.
class ChartLayout {
 public:
  /// Every triangle lies in its own plane at first.
  ChartLayout(const ProxySurface& surface, const ChartLimits& limits)
      : surface_(surface), limits_(limits), number_of_(3 * surface.triangles.size(), kNoIndex) {
    for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
      own_.emplace_back(
          std::array{corner_position(3 * t), corner_position(3 * t + 1), corner_position(3 * t + 2)});
      for (const Vec2d p : {Vec2d{}, Vec2d{own_[t].base, 0}, own_[t].apex}) places_.push_back(p);
    }
    tried_ = places_;
  }

  /// Whether there are places for a disk: along its mean normal, else those that keep its angles. False when
  /// a triangle would flip, two would overlap, or the stretch is too large.
  /// `vertices`: per corner 3 t + k of the surface, a number below 3 times the triangles; corners of the disk
  /// with one number have one place.
  bool can_lay(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
               const std::vector<std::uint32_t>& vertices, Vec3d area_normal) {
    const double most_stretch = std::max(kProjectionStretch, limits_.stretch);
    return try_projection(triangles, border, vertices, area_normal, most_stretch) ||
           try_unfolding(triangles, border, vertices);
  }

  /// Chooses the places of a disk that can_lay(): along its mean normal where that hardly stretches, else
  /// those that keep its angles, else along the normal as well.
  void lay(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
           const std::vector<std::uint32_t>& vertices, Vec3d area_normal) {
    if (!try_projection(triangles, border, vertices, area_normal, kProjectionStretch) &&
        !try_unfolding(triangles, border, vertices) &&
        !try_projection(triangles, border, vertices, area_normal, limits_.stretch))
      return;
    for (const std::uint32_t t : triangles)
      for (std::size_t c = 3 * std::size_t{t}; c < 3 * std::size_t{t} + 3; ++c) places_[c] = tried_[c];
  }

  /// Per corner 3 t + k, object units; y grows upwards for who looks at the front.
  const std::vector<Vec2d>& places() const { return places_; }

 private:
  bool try_projection(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
                      const std::vector<std::uint32_t>& vertices, Vec3d area_normal, double most_stretch) {
    project(triangles, area_normal);
    return is_sound(triangles, border, vertices, most_stretch);
  }
  bool try_unfolding(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
                     const std::vector<std::uint32_t>& vertices) {
    return unfold(triangles, border, vertices) && is_sound(triangles, border, vertices, limits_.stretch);
  }

  void project(std::span<const std::uint32_t> triangles, Vec3d area_normal) {
    const PlaneAxes axes(normalized(area_normal));
    for (const std::uint32_t t : triangles)
      for (std::uint32_t c = 3 * t; c < 3 * t + 3; ++c) tried_[c] = axes(corner_position(c));
  }

  bool unfold(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
              const std::vector<std::uint32_t>& vertices) {
    const std::size_t count = number_vertices(triangles, vertices);
    const std::uint32_t a = farthest(border, corner_position(border[0]));
    const std::uint32_t b = farthest(border, corner_position(a));
    const auto number = [&](std::uint32_t c) { return number_of_[vertices[c]]; };
    const double distance = length(corner_position(b) - corner_position(a));
    std::vector<Vec2d> found;
    if (number(a) != number(b))
      found = conformal_map(disk_, disk_own_, count, {number(a), number(b)}, distance);
    if (!found.empty())
      for (const std::uint32_t t : triangles)
        for (std::uint32_t c = 3 * t; c < 3 * t + 3; ++c) tried_[c] = found[number(c)];
    for (const std::uint32_t t : triangles)
      for (std::uint32_t c = 3 * t; c < 3 * t + 3; ++c) number_of_[vertices[c]] = kNoIndex;
    return !found.empty();
  }

  /// Gives the disk's vertices numbers, fills disk_, and returns how many vertices there are.
  std::size_t number_vertices(std::span<const std::uint32_t> triangles,
                              const std::vector<std::uint32_t>& vertices) {
    std::uint32_t count = 0;
    disk_.clear();
    disk_own_.clear();
    for (const std::uint32_t t : triangles) {
      Triangle numbered;
      for (std::size_t k = 0; k < 3; ++k) {
        std::uint32_t& number = number_of_[vertices[3 * std::size_t{t} + k]];
        if (number == kNoIndex) number = count++;
        numbered[k] = number;
      }
      disk_.push_back(numbered);
      disk_own_.push_back(own_[t]);
    }
    return count;
  }

  /// Checks the places tried and gives the chart its area.
  bool is_sound(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
                const std::vector<std::uint32_t>& vertices, double most_stretch) {
    double area = 0, flat_area = 0, stretch = 0, least2 = 1e300, largest2 = 0;
    for (const std::uint32_t t : triangles) {
      const FlatStretch s = flat_stretch(own_[t], &tried_[3 * std::size_t{t}]);
      if (!(s.area > 0) || !(s.least2 > 0) || s.largest2 > limits_.ratio * limits_.ratio * s.least2)
        return false;
      area += own_[t].area();
      flat_area += s.area;
      stretch += own_[t].area() * (1 / s.least2 + 1 / s.largest2) / 2;
      least2 = std::fmin(least2, s.least2);
      largest2 = std::fmax(largest2, s.largest2);
    }
    const double scale2 = area / flat_area;  // to the chart's area
    if (!(stretch <= most_stretch * most_stretch * area * scale2)) return false;
    if (least2 * scale2 * limits_.ratio * limits_.ratio < 1 ||
        largest2 * scale2 > limits_.ratio * limits_.ratio)
      return false;
    if (!border_is_simple(border, vertices, tried_)) return false;
    const double scale = std::sqrt(scale2);
    for (const std::uint32_t t : triangles)
      for (std::size_t c = 3 * std::size_t{t}; c < 3 * std::size_t{t} + 3; ++c) tried_[c] = tried_[c] * scale;
    return true;
  }

  Vec3d corner_position(std::uint32_t corner) const {
    return to_double(surface_.positions[surface_.triangles[corner / 3][corner % 3]]);
  }
  /// Of the border's half-edges, the one that begins farthest away.
  std::uint32_t farthest(std::span<const std::uint32_t> border, Vec3d from) const {
    std::uint32_t best = border[0];
    double most = -1;
    for (const std::uint32_t h : border) {
      const Vec3d d = corner_position(h) - from;
      if (const double d2 = dot(d, d); d2 > most) most = d2, best = h;
    }
    return best;
  }

  const ProxySurface& surface_;
  const ChartLimits limits_;
  std::vector<OwnPlane> own_;             // per triangle
  std::vector<Vec2d> places_, tried_;     // per corner
  std::vector<std::uint32_t> number_of_;  // per vertex: its number in the disk that is tried
  std::vector<Triangle> disk_;            // the disk's triangles, by these numbers
  std::vector<OwnPlane> disk_own_;
};

/// A chart that still grows. Dead ones, which are part of another, have no triangle.
struct GrowingChart {
  std::vector<std::uint32_t> triangles, border;  // border: half-edges 3 t + k, in no order
  Vec3d area_normal;                             // sum of unit normals times areas
  double area = 0, perimeter = 0;
  struct Refusal {
    std::uint32_t triangle;  // of the other chart
    std::size_t triangles;   // of both together
  };
  std::vector<Refusal> refusals;  // others that it could not be merged with
};

constexpr double kRoundnessShare = 0.3;
// At an edge of more triangles charts end: their pairs would take time that grows with the square.
constexpr std::size_t kMostSheets = 64;
// A pair that was refused is tried again when it has so many times the triangles. Trying it whenever one of
// the two has grown took most of the solver's time; with 4 for 1.25 a turtle had more charts, and .050 for
// .049 at 150 kB.
constexpr double kMuchLarger = 1.25;

/// Merges neighbouring charts, beginning with one per triangle, the flattest and roundest result first, as
/// long as the result is a chart that segment_charts promises.
class ChartMerge {
 public:
  ChartMerge(const ProxySurface& surface, const ChartLimits& limits)
      : surface_(surface), queue_(surface.triangles.size()), layout_(surface, limits) {
    measure_triangles();
    find_opposites();
    start_charts();
  }

  void run(const RunContext& context) {
    for (std::size_t steps = 0; !queue_.empty(); ++steps) {
      if (steps % 1024 == 0) context.check_cancelled();
      if (const QueuedPair pair = queue_.pop(); queue_.is_fresh(pair)) try_merge(pair.a, pair.b);
    }
    // While they grow, charts need to know only that there are places: the solver is dear.
    for (const GrowingChart& c : charts_)
      if (c.triangles.size() > 1) layout_.lay(c.triangles, c.border, vertices_, c.area_normal);
  }

  const std::vector<GrowingChart>& charts() const { return charts_; }
  const ChartLayout& layout() const { return layout_; }
  /// Per corner 3 t + k: corners that are one vertex of a chart have one number, below 3 times the triangles.
  const std::vector<std::uint32_t>& vertices() const { return vertices_; }

 private:
  void measure_triangles() {
    for (const Triangle& t : surface_.triangles) {
      std::array<Vec3d, 3> p;
      for (std::size_t k = 0; k < 3; ++k) p[k] = to_double(surface_.positions[t[k]]);
      area_normals_.push_back(cross(p[1] - p[0], p[2] - p[0]) * 0.5);
      areas_.push_back(length(area_normals_.back()));
      for (std::size_t k = 0; k < 3; ++k) lengths_.push_back(length(p[(k + 1) % 3] - p[k]));
    }
  }

  void find_opposites() {
    const std::span<const std::uint32_t> corners = corners_of(surface_.triangles);
    opposites_.assign(corners.size(), kNoIndex);
    const EdgeTable edges = group_edges(corners, surface_.positions.size());
    for (std::size_t e = 0; e < edges.edge_count(); ++e)
      if (edges.edge(e).size() <= kMostSheets) pair_half_edges(edges.edge(e));
  }

  /// Where several sheets meet in an edge, those go on in each other that turn least.
  void pair_half_edges(std::span<const std::uint32_t> half_edges) {
    struct Candidate {
      double turn;
      std::uint32_t a, b;
      auto operator<=>(const Candidate&) const = default;
    };
    std::vector<Candidate> candidates;
    for (std::size_t i = 0; i < half_edges.size(); ++i)
      for (std::size_t j = i + 1; j < half_edges.size(); ++j) {
        const std::uint32_t a = half_edges[i], b = half_edges[j];
        if (start_of(a) == start_of(b)) continue;  // not the same way round
        if (surface_.group[a / 3] != surface_.group[b / 3]) continue;
        candidates.push_back(
            {-dot(normalized(area_normals_[a / 3]), normalized(area_normals_[b / 3])), a, b});
      }
    std::sort(candidates.begin(), candidates.end());
    for (const auto& [turn, a, b] : candidates)
      if (opposites_[a] == kNoIndex && opposites_[b] == kNoIndex) opposites_[a] = b, opposites_[b] = a;
  }

  void start_charts() {
    const auto count = static_cast<std::uint32_t>(surface_.triangles.size());
    charts_.resize(count);
    shared_lengths_.assign(count, 0);
    vertices_.resize(3 * std::size_t{count});
    std::iota(vertices_.begin(), vertices_.end(), 0);
    glued_.assign(vertices_.size(), 0);
    renamed_.assign(vertices_.size(), kNoIndex);
    for (std::uint32_t t = 0; t < count; ++t) {
      chart_of_.push_back(t);
      const double perimeter = lengths_[3 * t] + lengths_[3 * t + 1] + lengths_[3 * t + 2];
      charts_[t] = {{t}, {3 * t, 3 * t + 1, 3 * t + 2}, area_normals_[t], areas_[t], perimeter, {}};
    }
    for (std::uint32_t t = 0; t < count; ++t) queue_neighbours(t, true);
  }

  void queue_neighbours(std::uint32_t chart, bool later_ones_only) {
    neighbours_.clear();
    for (const std::uint32_t h : charts_[chart].border) {
      if (opposites_[h] == kNoIndex) continue;
      const std::uint32_t other = chart_of_[opposites_[h] / 3];
      if (other == chart || (later_ones_only && other < chart)) continue;  // a cut inside the chart
      if (shared_lengths_[other] == 0) neighbours_.push_back(other);
      shared_lengths_[other] += lengths_[h];
    }
    for (const std::uint32_t other : neighbours_)
      queue_.push(chart, other,
                  merge_cost(charts_[chart], charts_[other], std::exchange(shared_lengths_[other], 0)));
  }

  double merge_cost(const GrowingChart& a, const GrowingChart& b, double shared_length) const {
    const double area = a.area + b.area;
    const double deviation = 1 - length(a.area_normal + b.area_normal) / area;
    const double perimeter = a.perimeter + b.perimeter - 2 * shared_length;
    return deviation + kRoundnessShare * perimeter * perimeter / (4 * portable::kPi * area);
  }

  /// Half-edges of a whose opposites are b's, one after the other on both borders: the longest such path.
  /// Disks that are glued along one path make a disk, whatever else they share. Empty when they share a whole
  /// border.
  std::vector<std::uint32_t> longest_common_path(std::uint32_t a, std::uint32_t b) const {
    std::vector<std::uint32_t> shared;
    for (const std::uint32_t h : charts_[a].border)
      if (opposites_[h] != kNoIndex && chart_of_[opposites_[h] / 3] == b) shared.push_back(h);
    std::sort(shared.begin(), shared.end(),
              [&](std::uint32_t g, std::uint32_t h) { return vertices_[g] < vertices_[h]; });
    const auto following = [&](std::uint32_t h) {
      const std::uint32_t end = vertices_[next_corner(h)];
      const auto at = std::lower_bound(shared.begin(), shared.end(), end,
                                       [&](std::uint32_t g, std::uint32_t v) { return vertices_[g] < v; });
      if (at == shared.end() || vertices_[*at] != end) return kNoIndex;
      return vertices_[next_corner(opposites_[*at])] == vertices_[opposites_[h]] ? *at : kNoIndex;
    };
    std::vector<std::uint32_t> starts = shared;
    for (const std::uint32_t h : shared)
      if (const std::uint32_t next = following(h); next != kNoIndex) std::erase(starts, next);
    std::sort(starts.begin(), starts.end());
    std::vector<std::uint32_t> best;
    double longest = 0;
    for (const std::uint32_t start : starts) {
      std::vector<std::uint32_t> path;
      double path_length = 0;
      for (std::uint32_t h = start; h != kNoIndex; h = following(h)) {
        path.push_back(h);
        path_length += lengths_[h];
      }
      if (path_length > longest) longest = path_length, best = std::move(path);
    }
    if (best.empty()) return best;
    // A path that comes back to its beginning on one of the borders would leave a ring, or a sphere.
    const std::uint32_t first = best.front(), last = best.back();
    if (vertices_[first] == vertices_[next_corner(last)] ||
        vertices_[next_corner(opposites_[first])] == vertices_[opposites_[last]])
      best.pop_back();
    return best;
  }

  /// Gives the corners of `triangles`, which lie on the other side of the path, the vertices of this side.
  void glue(std::span<const std::uint32_t> path, std::span<const std::uint32_t> triangles) {
    std::vector<std::uint32_t> old;
    const auto rename = [&](std::uint32_t from, std::uint32_t to) {
      renamed_[from] = to;
      old.push_back(from);
    };
    for (const std::uint32_t h : path) {
      rename(vertices_[next_corner(opposites_[h])], vertices_[h]);
      rename(vertices_[opposites_[h]], vertices_[next_corner(h)]);
    }
    for (const std::uint32_t t : triangles)
      for (std::uint32_t c = 3 * t; c < 3 * t + 3; ++c)
        if (renamed_[vertices_[c]] != kNoIndex) vertices_[c] = renamed_[vertices_[c]];
    for (const std::uint32_t v : old) renamed_[v] = kNoIndex;
  }

  bool try_merge(std::uint32_t a, std::uint32_t b) {
    if (charts_[a].triangles.size() < charts_[b].triangles.size()) std::swap(a, b);
    GrowingChart& into = charts_[a];
    GrowingChart& from = charts_[b];
    if (was_refused(a, b) || was_refused(b, a)) return false;
    const std::vector<std::uint32_t> path = longest_common_path(a, b);
    if (path.empty()) return false;  // they close around each other
    std::vector<std::uint32_t> border = joint_border(a, b, path), triangles = into.triangles, before;
    triangles.insert(triangles.end(), from.triangles.begin(), from.triangles.end());
    for (const std::uint32_t t : from.triangles)
      before.insert(before.end(), &vertices_[3 * t], &vertices_[3 * t] + 3);
    glue(path, from.triangles);
    if (!layout_.can_lay(triangles, border, vertices_, into.area_normal + from.area_normal)) {
      for (std::size_t i = 0; i < before.size(); ++i)
        vertices_[3 * from.triangles[i / 3] + i % 3] = before[i];
      into.refusals.push_back({from.triangles.front(), triangles.size()});
      return false;
    }
    into.border = std::move(border);
    into.area_normal = into.area_normal + from.area_normal;
    into.area += from.area;
    into.perimeter = 0;
    for (const std::uint32_t h : into.border) into.perimeter += lengths_[h];
    for (const std::uint32_t t : from.triangles) chart_of_[t] = a;
    into.triangles = std::move(triangles);
    into.refusals.insert(into.refusals.end(), from.refusals.begin(), from.refusals.end());
    std::erase_if(into.refusals, [&](const GrowingChart::Refusal& r) { return chart_of_[r.triangle] == a; });
    from = {};
    queue_.touch(a);
    queue_.touch(b);
    queue_neighbours(a, false);
    return true;
  }

  /// Whether the first chart remembers that both, when they were not much smaller, made no disk to lay flat.
  bool was_refused(std::uint32_t a, std::uint32_t b) const {
    const auto triangles = static_cast<double>(charts_[a].triangles.size() + charts_[b].triangles.size());
    return std::ranges::any_of(charts_[a].refusals, [&](const GrowingChart::Refusal& r) {
      return chart_of_[r.triangle] == b && triangles < kMuchLarger * static_cast<double>(r.triangles);
    });
  }

  std::vector<std::uint32_t> joint_border(std::uint32_t a, std::uint32_t b,
                                          std::span<const std::uint32_t> path) {
    for (const std::uint32_t h : path) glued_[h] = glued_[opposites_[h]] = 1;
    std::vector<std::uint32_t> border;
    for (const std::uint32_t chart : {a, b})
      for (const std::uint32_t h : charts_[chart].border)
        if (!glued_[h]) border.push_back(h);
    for (const std::uint32_t h : path) glued_[h] = glued_[opposites_[h]] = 0;
    return border;
  }

  std::uint32_t start_of(std::uint32_t half_edge) const {
    return surface_.triangles[half_edge / 3][half_edge % 3];
  }

  const ProxySurface& surface_;
  std::vector<Vec3d> area_normals_;       // per triangle: unit normal times area
  std::vector<double> areas_;             // per triangle
  std::vector<double> lengths_;           // per half-edge
  std::vector<std::uint32_t> opposites_;  // per half-edge; kNoIndex where no chart goes on
  std::vector<std::uint32_t> chart_of_;   // per triangle
  std::vector<GrowingChart> charts_;
  PairQueue queue_;
  ChartLayout layout_;
  std::vector<std::uint32_t> vertices_;  // per corner: corners that are one vertex of a chart have one number
  std::vector<std::uint8_t> glued_;      // per half-edge: 1 on the path in hand
  std::vector<std::uint32_t> renamed_;   // per vertex: its new number, or kNoIndex
  std::vector<double> shared_lengths_;   // per chart; 0 between calls
  std::vector<std::uint32_t> neighbours_;
};

/// Turns a chart so that the box around it is small, and moves the box to the origin.
void turn_chart(const GrowingChart& chart, const std::vector<Vec2d>& places, SurfaceCharts& out) {
  std::vector<Vec2d> points;
  for (const std::uint32_t t : chart.triangles)
    for (std::size_t k = 0; k < 3; ++k) points.push_back(places[3 * std::size_t{t} + k]);
  const Vec2d side = smallest_box_side(points);
  for (Vec2d& p : points) p = {dot(side, p), cross(side, p)};
  Vec2d low = points[0], high = points[0];
  for (const Vec2d p : points) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  for (std::size_t i = 0; i < points.size(); ++i)
    out.plane[3 * std::size_t{chart.triangles[i / 3]} + i % 3] = points[i] - low;
  out.size.push_back(high - low);
}

struct BorderSegment {
  Vec2d from, to;
  std::uint32_t from_vertex = 0, to_vertex = 0;
  double left() const { return std::min(from.x, to.x); }
  double right() const { return std::max(from.x, to.x); }
  bool shares_end(const BorderSegment& o) const {
    return from_vertex == o.from_vertex || from_vertex == o.to_vertex || to_vertex == o.from_vertex ||
           to_vertex == o.to_vertex;
  }
};

bool ranges_meet(double a, double b, double c, double d) {
  return std::max(a, b) >= std::min(c, d) && std::max(c, d) >= std::min(a, b);
}

bool segments_meet(const BorderSegment& s, const BorderSegment& t) {
  if (!ranges_meet(s.from.y, s.to.y, t.from.y, t.to.y)) return false;
  const auto side = [](const BorderSegment& of, Vec2d p) { return cross(of.to - of.from, p - of.from); };
  return side(s, t.from) * side(s, t.to) <= 0 && side(t, s.from) * side(t, s.to) <= 0;
}

std::vector<Vec2d> convex_hull(std::vector<Vec2d> points) {
  std::sort(points.begin(), points.end(),
            [](Vec2d a, Vec2d b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points;
  std::vector<Vec2d> hull;
  const auto add = [&](Vec2d p, std::size_t least) {
    while (hull.size() >= least + 2 && cross(hull.back() - hull[hull.size() - 2], p - hull.back()) <= 0)
      hull.pop_back();
    hull.push_back(p);
  };
  for (const Vec2d p : points) add(p, 0);
  const std::size_t lower = hull.size() - 1;
  for (std::size_t i = points.size() - 1; i-- > 0;) add(points[i], lower);
  hull.pop_back();
  return hull;
}

}  // namespace

SurfaceCharts segment_charts(const ProxySurface& surface, const RunContext& context,
                             const ChartLimits& limits) {
  ChartMerge merge(surface, limits);
  merge.run(context);
  std::vector<std::uint32_t> chart_of(surface.triangles.size());
  for (std::uint32_t c = 0; c < merge.charts().size(); ++c)
    for (const std::uint32_t t : merge.charts()[c].triangles) chart_of[t] = c;

  SurfaceCharts out;
  out.chart_of.resize(surface.triangles.size());
  out.plane.resize(3 * surface.triangles.size());
  std::vector<std::uint32_t> number(merge.charts().size(), kNoIndex);
  for (std::size_t t = 0; t < chart_of.size(); ++t) {
    if (number[chart_of[t]] == kNoIndex) {
      number[chart_of[t]] = out.chart_count++;
      turn_chart(merge.charts()[chart_of[t]], merge.layout().places(), out);
    }
    out.chart_of[t] = number[chart_of[t]];
  }
  out.vertex_of.resize(out.plane.size());
  std::vector<std::uint32_t> vertex(out.plane.size(), kNoIndex);
  for (std::size_t c = 0; c < out.plane.size(); ++c) {
    std::uint32_t& renumbered = vertex[merge.vertices()[c]];
    if (renumbered == kNoIndex) renumbered = out.vertex_count++;
    out.vertex_of[c] = renumbered;
  }
  return out;
}

PlaneAxes::PlaneAxes(Vec3d n) {
  const Vec3d size{std::fabs(n.x), std::fabs(n.y), std::fabs(n.z)};
  const int least = size.x <= size.y && size.x <= size.z ? 0 : size.y <= size.z ? 1 : 2;
  Vec3d helper;
  helper[least] = 1;
  x = normalized(cross(helper, n));
  y = cross(n, x);
}

OwnPlane::OwnPlane(const std::array<Vec3d, 3>& p) {
  const Vec3d along = p[1] - p[0], other = p[2] - p[0];
  base = length(along);
  if (!(base > 0)) return;
  apex = {dot(other, along) / base, length(cross(along, other)) / base};
}

FlatStretch flat_stretch(const OwnPlane& own, const Vec2d* p) {
  const Vec2d s = (p[1] - p[0]) * (1 / own.base);
  const Vec2d t = (p[2] - p[0] - s * own.apex.x) * (1 / own.apex.y);
  const double ss = dot(s, s), tt = dot(t, t), st = dot(s, t);
  const double root = std::sqrt((ss - tt) * (ss - tt) + 4 * st * st), determinant = cross(s, t);
  const double largest2 = (ss + tt + root) / 2;
  // The difference (ss + tt - root) / 2 would lose its digits.
  return {largest2, largest2 > 0 ? determinant * determinant / largest2 : 0, determinant * own.area()};
}

bool border_is_simple(std::span<const std::uint32_t> half_edges, const std::vector<std::uint32_t>& vertices,
                      const std::vector<Vec2d>& places) {
  std::vector<BorderSegment> segments;
  segments.reserve(half_edges.size());
  for (const std::uint32_t h : half_edges) {
    const std::uint32_t next = next_corner(h);
    segments.push_back({places[h], places[next], vertices[h], vertices[next]});
  }
  std::sort(segments.begin(), segments.end(), [](const BorderSegment& a, const BorderSegment& b) {
    return a.left() != b.left() ? a.left() < b.left() : a.from_vertex < b.from_vertex;
  });
  for (std::size_t i = 0; i < segments.size(); ++i)
    for (std::size_t j = i + 1; j < segments.size() && segments[j].left() <= segments[i].right(); ++j)
      if (!segments[i].shares_end(segments[j]) && segments_meet(segments[i], segments[j])) return false;
  return true;
}

Vec2d smallest_box_side(std::vector<Vec2d> points) {
  const std::vector<Vec2d> hull = convex_hull(std::move(points));
  double least = std::numeric_limits<double>::infinity();
  Vec2d best{1, 0};
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Vec2d edge = hull[(i + 1) % hull.size()] - hull[i];
    const double size = std::sqrt(dot(edge, edge));
    if (!(size > 0)) continue;
    const Vec2d side = edge * (1 / size);
    double left = 0, right = 0, top = 0;  // the hull lies on one side of its edge
    for (const Vec2d p : hull) {
      const double along = dot(p - hull[i], side);
      left = std::min(left, along);
      right = std::max(right, along);
      top = std::max(top, cross(side, p - hull[i]));
    }
    if (const double area = (right - left) * top; area < least) least = area, best = side;
  }
  return best;
}

}  // namespace texmesh
