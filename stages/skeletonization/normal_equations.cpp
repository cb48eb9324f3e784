#include "stages/skeletonization/contraction_parts.h"

#include <Eigen/SparseCholesky>

#include "stages/skeletonization/wrap.h"

namespace texmesh {

struct NormalEquations::Factors {
  Eigen::SparseMatrix<double> a;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> of_normal;
};

NormalEquations::NormalEquations() : factors_(std::make_unique<Factors>()) {}
NormalEquations::~NormalEquations() = default;

void NormalEquations::normal_equation_factor(const Matrix& a) {
  factors_->a = Eigen::SparseMatrix<double>(a.rows, a.columns);
  factors_->a.setFromTriplets(a.coefficients.begin(), a.coefficients.end());
  const Eigen::SparseMatrix<double> transposed = factors_->a.transpose();
  factors_->of_normal.compute(transposed * factors_->a);
  if (factors_->of_normal.info() != Eigen::Success) throw GeometryFailure("contraction cannot be solved");
}

void NormalEquations::normal_equation_solver(const Vector& b, Vector& x) {
  const Eigen::Map<const Eigen::VectorXd> right(b.data(), static_cast<Eigen::Index>(b.size()));
  const Eigen::VectorXd product = factors_->a.transpose() * right;
  Eigen::Map<Eigen::VectorXd>(x.data(), static_cast<Eigen::Index>(x.size())) =
      factors_->of_normal.solve(product);
}

}  // namespace texmesh
