#include "stages/proxies/charts/conformal_map.h"

#include <Eigen/SparseCholesky>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>

namespace texmesh {
namespace {

using Complex = std::complex<double>;

/// Whatever the map, sum over corners of weight times place is 0 where the triangle keeps its angles.
std::array<Complex, 3> corner_weights(const OwnPlane& own) {
  const Complex a = 0, b = own.base, c(own.apex.x, own.apex.y);
  const double scale = 1 / std::sqrt(2 * own.area());
  return {(c - b) * scale, (a - c) * scale, (b - a) * scale};
}

}  // namespace

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

}  // namespace texmesh
