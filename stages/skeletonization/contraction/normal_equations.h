#pragma once
#include <cstddef>
#include <memory>
#include <vector>

namespace texmesh {

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
