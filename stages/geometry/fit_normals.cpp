#include "stages/geometry/fit_normals.h"

#include "stages/base/parallel.h"
#include "stages/geometry/triangle_tree.h"

namespace texmesh {
namespace {

constexpr std::size_t kMostSamples = 400000;
constexpr int kFitSteps = 4;
constexpr double kLeastCosine = 0.25;  // cosine between a sample and the face that it is put on

/// What a sample says about three normals.
struct Tie {
  std::array<double, 3> weight{};
  std::uint32_t triangle = 0;
  bool used = false;
};

std::vector<Tie> ties_of(std::span<const Vec3d> points, std::span<const Triangle> triangles,
                         const NormalSamples& samples, const RunContext& context) {
  const TriangleTree tree(points, triangles);
  std::vector<Tie> out(samples.places.size());
  parallel_for(context, out.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      const TriangleTree::Nearest found = tree.nearest(samples.places[s]);
      const Triangle& t = triangles[found.triangle];
      const Vec3d face = normalized(cross(points[t[1]] - points[t[0]], points[t[2]] - points[t[0]]));
      out[s] = {found.weight, found.triangle, dot(face, to_double(samples.normals[s])) > kLeastCosine};
    }
  });
  return out;
}

/// One step of least squares with lumped weights, which never overshoots.
void improve(std::span<const Triangle> triangles, const std::vector<Tie>& ties, const NormalSamples& samples,
             std::vector<Vec3d>& normals) {
  std::vector<Vec3d> change(normals.size());
  std::vector<double> weight(normals.size());
  for (std::size_t s = 0; s < ties.size(); ++s) {
    if (!ties[s].used) continue;
    const Triangle& t = triangles[ties[s].triangle];
    Vec3d here;
    for (std::size_t k = 0; k < 3; ++k) here = here + normals[t[k]] * ties[s].weight[k];
    const Vec3d missing = to_double(samples.normals[s]) - normalized(here);
    for (std::size_t k = 0; k < 3; ++k) {
      const double w = ties[s].weight[k] * samples.areas[s];
      change[t[k]] = change[t[k]] + missing * w;
      weight[t[k]] += w;
    }
  }
  for (std::size_t i = 0; i < normals.size(); ++i) {
    if (!(weight[i] > 0)) continue;
    const Vec3d next = normals[i] + change[i] * (1 / weight[i]);
    if (dot(next, next) > 1e-6) normals[i] = normalized(next);
  }
}

}  // namespace

NormalSamples normal_samples(const Mesh& mesh) {
  NormalSamples out;
  if (mesh.normals.empty()) return out;
  std::vector<double> areas(mesh.wedge_count());
  for (const Triangle& t : mesh.triangles) {
    const auto at = [&](std::size_t k) { return to_double(mesh.positions[mesh.wedge_position[t[k]]]); };
    const double area = length(cross(at(1) - at(0), at(2) - at(0))) / 6;
    for (const std::uint32_t w : t) areas[w] += area;
  }
  const std::size_t every = mesh.wedge_count() / kMostSamples + 1;
  for (std::size_t w = 0; w < mesh.wedge_count(); w += every) {
    if (!(areas[w] > 0)) continue;
    out.places.push_back(to_double(mesh.positions[mesh.wedge_position[w]]));
    out.normals.push_back(mesh.normals[w]);
    out.areas.push_back(areas[w]);
  }
  return out;
}

std::vector<Vec3f> fit_normals(std::span<const Vec3d> points, std::span<const Triangle> triangles,
                               std::vector<Vec3f> normals, const NormalSamples& samples,
                               const RunContext& context) {
  if (triangles.empty() || samples.places.empty()) return normals;
  const std::vector<Tie> ties = ties_of(points, triangles, samples, context);
  std::vector<Vec3d> fitted;
  for (const Vec3f n : normals) fitted.push_back(to_double(n));
  for (int i = 0; i < kFitSteps; ++i) improve(triangles, ties, samples, fitted);
  for (std::size_t i = 0; i < normals.size(); ++i) normals[i] = to_float(fitted[i]);
  return normals;
}

}  // namespace texmesh
