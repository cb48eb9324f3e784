#pragma once
#include <array>
#include <memory>
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// Whether points are inside a closed surface, with CGAL's exact predicates: the parity of a ray's crossings.
/// A ray that meets an edge says nothing, and CGAL tries another, which never ends on surfaces that lie on
/// themselves (known upstream). Single-threaded.
class InsideTest {
 public:
  using Corners = std::array<Vec3d, 3>;
  explicit InsideTest(const std::vector<Corners>& triangles);
  ~InsideTest();
  InsideTest(const InsideTest&) = delete;
  InsideTest& operator=(const InsideTest&) = delete;

  /// False on the surface, too. GeometryFailure after 1,000 rays in a row from one point, over all tests of
  /// this thread since it forgot its rays: of an overflowing surface all points to be tested are the origin.
  bool is_inside(Vec3d point) const;
  /// Called before each contraction, so that none depends on the ones before it.
  static void forget_rays();

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace texmesh
