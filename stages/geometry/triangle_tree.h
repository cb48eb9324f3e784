#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "format/base/box.h"
#include "format/base/vec.h"
#include "format/model/model.h"
#include "stages/geometry/box_quad.h"
#include "stages/geometry/tetrahedron.h"

namespace texmesh {

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
  struct Node {
    Box3d box;
    std::uint32_t first = 0, count = 0;  // triangles of a leaf; count 0: children at index + 1 and `first`
  };
  struct Found;
  struct LineSearch;
  struct RayBundle;
  Found search(Vec3d p, double limit2, std::uint64_t& tried) const;
  void build(std::uint32_t first, std::uint32_t count, std::vector<Vec3d>& centres);
  std::uint32_t add_quad(std::uint32_t node);

  std::vector<std::array<Vec3d, 3>> corners_;  // in the order of order_
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> place_;  // the reverse of order_
  std::vector<Node> nodes_;
  std::vector<BoxQuad> quads_;  // the same tree, four children a node
  double largest_ = 0;          // coordinate
};

}  // namespace texmesh
