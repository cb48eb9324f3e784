#pragma once
// Inside the room only: what CGAL's contraction asks for. Each has a source of its own: together they take
// long to compile.
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

/// Per point of a closed surface, the corner of its Voronoi cell that lies farthest inside, against its
/// outward normal (Amenta and Bern 1999). A point that shares its place with another has that one's pole, and
/// a point with no corner inside has the origin. Corners are computed exactly and then rounded. Sizes of
/// `points` and `normals` are equal. Deterministic, single-threaded.
std::vector<Vec3d> voronoi_poles(const std::vector<Vec3d>& points, const std::vector<Vec3d>& normals);

/// A linear solver as CGAL's contraction asks for one (NormalEquationSparseLinearAlgebraTraits_d), over
/// Eigen's sparse Cholesky factors of A^t A. It does what CGAL::Eigen_solver_traits does; Eigen stays out of
/// the file that CGAL fills. Deterministic, single-threaded.
class NormalEquations {
 public:
  using NT = double;
  using Vector = std::vector<double>;

  /// Coefficients in the order in which they are set. `as_new` is a promise that holds of every one.
  struct Matrix {
    struct Coefficient {
      int row_, column_;
      double value_;
      int row() const { return row_; }
      int col() const { return column_; }
      double value() const { return value_; }
    };
    Matrix(int row_count, int column_count) : rows(row_count), columns(column_count) {}
    void set_coef(std::size_t row, std::size_t column, double value, bool /*as_new*/) {
      coefficients.push_back({static_cast<int>(row), static_cast<int>(column), value});
    }
    int rows, columns;
    std::vector<Coefficient> coefficients;
  };

  NormalEquations();
  ~NormalEquations();
  NormalEquations(const NormalEquations&) = delete;
  NormalEquations& operator=(const NormalEquations&) = delete;

  /// GeometryFailure where A^t A has no factors.
  void normal_equation_factor(const Matrix& a);
  /// x = (A^t A)^-1 A^t b.
  void normal_equation_solver(const Vector& b, Vector& x);

 private:
  struct Factors;
  std::unique_ptr<Factors> factors_;
};

}  // namespace texmesh
