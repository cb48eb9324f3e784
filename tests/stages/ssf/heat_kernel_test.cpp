#include "stages/ssf/heat_kernel.h"

#include <gtest/gtest.h>

#include <eigen3/Eigen/Dense>

#include <algorithm>
#include <cmath>

#include "tests/stages/ssf/ssf_checks.h"
#include "tests/support/even_sphere.h"
#include "tests/support/meshes.h"

namespace texmesh::heat_kernel_test {

using namespace testing;  // NOLINT: fixtures

TEST(HeatKernel, MatchesADenseEigenSolveOfTheSameOperator) {
  const Surface s = surface_of(testing::bumpy_sphere(22, 40, 0.08f));
  const HeatOperator l = make_heat_operator({s.points, s.corners, {}}, {}, s.mean_edge, 10);
  const auto n = static_cast<Eigen::Index>(s.points.size());
  // L is similar to a symmetric matrix by the roots of the masses; those follow from w_ij = w_ji row by row.
  Eigen::VectorXd root = Eigen::VectorXd::Zero(n);
  Eigen::MatrixXd symmetric = Eigen::MatrixXd::Zero(n, n);
  std::vector<std::uint32_t> queue{0};
  root[0] = 1;
  for (std::size_t q = 0; q < queue.size(); ++q)
    for (std::uint32_t k = l.first[queue[q]]; k < l.first[queue[q] + 1]; ++k) {
      const std::uint32_t i = queue[q], j = l.column[k];
      double back = 0;
      for (std::uint32_t e = l.first[j]; e < l.first[j + 1]; ++e)
        back = l.column[e] == i ? double{l.rate[e]} : back;
      symmetric(i, j) = -std::sqrt(double{l.rate[k]} * back);
      symmetric(i, i) += double{l.rate[k]};
      if (root[j] == 0) {
        root[j] = root[i] * std::sqrt(double{l.rate[k]} / back);
        queue.push_back(j);
      }
    }
  ASSERT_EQ(queue.size(), s.points.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(symmetric);
  EXPECT_LE(eigen.eigenvalues()[n - 1], l.bound);
  EXPECT_NEAR(eigen.eigenvalues()[0], 0, 1e-9 * l.bound);
  Eigen::MatrixXd x(n, 3);
  for (Eigen::Index i = 0; i < n; ++i)
    for (int k = 0; k < 3; ++k) x(i, k) = s.points[static_cast<std::size_t>(i)][k];

  std::vector<double> times;
  for (double sigma = s.mean_edge; sigma < 1.3; sigma *= 1.4) times.push_back(0.5 * sigma * sigma);
  ASSERT_GT(times.size(), 5u);
  const std::vector<HeatFlow> flows = diffuse(l, s.points, 0, times, RunContext{});
  for (std::size_t t = 0; t < times.size(); ++t) {
    const auto apply = [&](auto&& f) -> Eigen::MatrixXd {
      Eigen::VectorXd d(n);
      for (Eigen::Index i = 0; i < n; ++i) d[i] = f(times[t] * std::max(0.0, eigen.eigenvalues()[i]));
      const Eigen::MatrixXd y = eigen.eigenvectors().transpose() * (root.asDiagonal() * x);
      return root.cwiseInverse().asDiagonal() * (eigen.eigenvectors() * (d.asDiagonal() * y));
    };
    const Eigen::MatrixXd smooth = apply([](double v) { return std::exp(-v); }),
                          response = apply([](double v) { return v * std::exp(-v); });
    double error = 0, size = 0, smooth_error = 0;
    int flips = 0;
    for (Eigen::Index i = 0; i < n; ++i)
      for (int k = 0; k < 3; ++k) {
        const double at = flows[t].response[static_cast<std::size_t>(i)][k],
                     moved = flows[t].moved[static_cast<std::size_t>(i)][k];
        error += std::pow(at - response(i, k), 2);
        size += std::pow(response(i, k), 2);
        smooth_error = std::max(smooth_error, std::fabs(x(i, k) + moved - smooth(i, k)));
        flips += (at < 0) != (response(i, k) < 0);
      }
    EXPECT_LE(std::sqrt(error / size), 0.002) << "time " << t;
    EXPECT_LE(flips, std::max(1.0, 0.001 * 3 * static_cast<double>(n))) << "time " << t;
    EXPECT_LE(smooth_error, 2e-5) << "time " << t;
  }
}

TEST(HeatKernel, AFewFastVerticesDoNotSetThePaceOfAll) {
  const Surface s = surface_of(testing::bumpy_sphere(40, 60, 0.08f));
  HeatOperator l = make_heat_operator({s.points, s.corners, {}}, {}, s.mean_edge, 10);
  const HeatOperator before = l;
  trim_spectrum(l, 0);
  EXPECT_EQ(l.rate, before.rate) << "nobody is to be slowed down";
  trim_spectrum(l, 0.1);
  EXPECT_LT(l.bound, 0.8 * before.bound);
  std::size_t slower = 0;
  for (std::size_t v = 0; v < l.vertex_count(); ++v) {
    double sum = 0, was = 0;
    for (std::uint32_t k = l.first[v]; k < l.first[v + 1]; ++k)
      sum += double{l.rate[k]}, was += double{before.rate[k]};
    slower += was > 0.5 * l.bound * (1 + 1e-5);
    EXPECT_LE(sum, was * (1 + 1e-6));
  }
  EXPECT_GT(slower, 0u);
  EXPECT_LE(static_cast<double>(slower), 0.1 * static_cast<double>(l.vertex_count()) + 1);
  HeatOperator small = before;
  trim_spectrum(small, 0.9 / static_cast<double>(l.vertex_count()));
  EXPECT_EQ(small.rate, before.rate) << "less than one vertex is none";
}

}  // namespace texmesh::heat_kernel_test
