#pragma once
// Inside the room only: four boxes that a line is tried against at once.
#ifdef __SSE2__
#endif
#include <emmintrin.h>

#include <optional>
#include <span>

#include "format/model/model.h"
#include "stages/geometry/box_tree.h"

namespace texmesh {

/// Four boxes in single precision, rounded as it comes: QuadLine makes up for it.
struct BoxQuad {
  static constexpr std::size_t kBoxes = 4;
  using Lanes = float __attribute__((vector_size(16)));
  std::array<Lanes, 3> low{}, high{};
  std::array<std::uint32_t, kBoxes> first{}, count{};  // count 0: `first` is another quad's index
  unsigned used = 0;                                   // a bit for each box that is set

  void set(std::size_t i, const Box3d& box, std::uint32_t first_at, std::uint32_t count_of) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k][i] = static_cast<float>(box.min[static_cast<int>(k)]);
      high[k][i] = static_cast<float>(box.max[static_cast<int>(k)]);
    }
    first[i] = first_at, count[i] = count_of;
    used |= 1u << i;
  }
};

/// A piece of a line to both sides of its origin. What it says of boxes errs to the side of meeting them, so
/// rounding never loses one.
class QuadLine {
 public:
  using Lanes = BoxQuad::Lanes;

  /// `direction` is unit; no coordinate of a box is larger than `largest`; no limit is above `reach`.
  QuadLine(Vec3d origin, Vec3d direction, double reach, double largest)
      : slack_(static_cast<float>(reach) * 1e-5f) {
    constexpr double kMostInverse = 1e15;
    for (int k = 0; k < 3; ++k) largest = std::max(largest, std::fabs(origin[k]));
    const double margin = largest * 1e-6;  // eight units in the last place of the largest number
    for (std::size_t k = 0; k < 3; ++k) {
      const int axis = static_cast<int>(k);
      from_low_[k] = Lanes{} + static_cast<float>(origin[axis] + margin);
      from_high_[k] = Lanes{} + static_cast<float>(origin[axis] - margin);
      inverse_[k] =
          Lanes{} + static_cast<float>(std::clamp(1 / direction[axis], -kMostInverse, kMostInverse));
    }
  }

  /// A bit for each box that the line may meet within `limit` to either side; at[i] is at most the least
  /// distance of box i.
  unsigned meets(const BoxQuad& quad, double limit, Lanes& at) const {
    const Lanes most = Lanes{} + (static_cast<float>(limit) + slack_);
    Lanes from = -most, to = most;
    for (std::size_t k = 0; k < 3; ++k) {
      const Lanes a = (quad.low[k] - from_low_[k]) * inverse_[k],
                  b = (quad.high[k] - from_high_[k]) * inverse_[k];
      const Lanes nearer = a < b ? a : b, farther = a > b ? a : b;
      from = from > nearer ? from : nearer;
      to = to < farther ? to : farther;
    }
    const Lanes ahead = from > -to ? from : -to;
    at = ahead - slack_;
    return bits(from <= to + 2 * slack_) & quad.used;
  }

 private:
  using Flags = decltype(Lanes{} < Lanes{});
  static unsigned bits(Flags flags) {
#ifdef __SSE2__
    return static_cast<unsigned>(_mm_movemask_ps(reinterpret_cast<__m128>(flags)));
#else
    unsigned out = 0;
    for (std::size_t i = 0; i < BoxQuad::kBoxes; ++i) out |= (static_cast<unsigned>(flags[i]) & 1u) << i;
    return out;
#endif
  }

  float slack_;
  std::array<Lanes, 3> from_low_, from_high_, inverse_;
};

/// A solid tetrahedron that is asked what it meets, in plain double arithmetic: what only touches it may be
/// answered either way.
class Tetrahedron {
 public:
  /// Corners a, b, c, d with dot(cross(b - a, c - a), d - a) > 0, or so flat that rounding hides it.
  explicit Tetrahedron(const std::array<Vec3d, 4>& corners);

  /// False when it surely meets no part of the box; true may be wrong.
  bool may_meet_box(const Box3d& box) const;
  /// Whether it and a triangle, inside included, have a point in common.
  bool meets(const std::array<Vec3d, 3>& triangle) const;

 private:
  struct Plane {
    Vec3d inwards, point;
    double height(Vec3d p) const { return dot(inwards, p - point); }
  };
  /// Whether the four sides leave anything of a triangle.
  bool clipped(const std::array<Vec3d, 3>& triangle) const;

  std::array<Vec3d, 4> corners_;
  std::array<Plane, 4> planes_;
  Box3d box_;
};

/// The point of a triangle that is closest to another point.
struct OnTriangle {
  double distance2 = 0;            // square of the distance
  std::array<double, 3> weight{};  // of the corners, >= 0, summing to 1
};
OnTriangle closest_on_triangle(const std::array<Vec3d, 3>& corners, Vec3d p);

/// A bounding-volume tree over a triangle mesh for rays and closest points, in plain double
/// arithmetic: the same bits on every machine, which a ray caster with SIMD dispatch does not promise.
/// Binary, split at the median of the centres. Safe to ask from many threads.
class TriangleTree {
 public:
  /// At least one triangle; indices below points.size().
  TriangleTree(std::span<const Vec3d> points, std::span<const Triangle> triangles);

  /// Rays that begin at one point; they are fastest where they look about the same way.
  static constexpr std::size_t kRays = 16;
  using Rays = std::array<Vec3d, kRays>;
  /// For each direction the least t > 0 at which origin + t * direction leaves the solid, that is crosses a
  /// triangle whose normal looks along the direction; infinite when it does not. Rays through an edge may
  /// count as hits or misses.
  std::array<double, kRays> exits(Vec3d origin, const Rays& directions) const;

  struct Nearest {
    std::uint32_t triangle = 0;      // index in the constructor's list; ties: the first one found
    std::array<double, 3> weight{};  // of its corners, >= 0, summing to 1
  };
  Nearest nearest(Vec3d p) const;
  /// The same; `tried` grows by the triangles that were looked at: what a query costs, the same on every
  /// machine.
  Nearest nearest(Vec3d p, std::uint64_t& tried) const;

  /// Which sides of triangles count: those whose unit normal n has dot(n, direction) > least_cosine.
  struct Facing {
    Vec3d direction;  // unit
    double least_cosine = 0;
  };
  /// Where origin + t * direction (unit) crosses a triangle that faces so, of all |t| <= reach the least one;
  /// ties: the lowest index. `guess`, a triangle's index, makes the search faster where it is right and
  /// changes nothing.
  std::optional<Nearest> crossing(Vec3d origin, Vec3d direction, double reach, const Facing& facing,
                                  std::optional<std::uint32_t> guess) const;
  /// The closest point on triangles that face so; ties: the lowest index. Nothing where none does.
  std::optional<Nearest> nearest_facing(Vec3d p, const Facing& facing) const;

  /// Square of the distance to the closest point; infinite when that is not below `limit2`, where the search
  /// ends.
  double distance2(Vec3d p, double limit2, std::uint64_t& tried) const;
  /// Whether any triangle meets the solid.
  bool meets(const Tetrahedron& solid, std::uint64_t& tried) const;
  /// The box around all triangles.
  const Box3d& box() const { return nodes_[0].box; }

 private:
  struct Found;
  struct LineSearch;
  struct RayBundle;
  Found search(Vec3d p, double limit2, std::uint64_t& tried) const;
  void build(std::uint32_t first, std::uint32_t count, std::vector<Vec3d>& centres);
  std::uint32_t add_quad(std::uint32_t node);

  std::vector<std::array<Vec3d, 3>> corners_;  // in the order of order_
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> place_;  // the reverse of order_
  std::vector<BoxNode> nodes_;
  std::vector<BoxQuad> quads_;  // the same tree, four children a node
  double largest_ = 0;          // coordinate
};

}  // namespace texmesh
