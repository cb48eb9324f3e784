#include "stages/skeletonization.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <stdexcept>
#include <string>
#include <utility>

#include "stages/contraction.h"
#include "stages/parallel.h"
#include "stages/segment_tree.h"
#include "stages/wrap.h"

namespace texmesh {
namespace {

/// Soups larger than this are clustered to it first: the wrap looks at nothing finer than its alpha.
constexpr std::size_t kMaxSoup = 100000;
/// No radius is smaller than this fraction of the diagonal: R divides.
constexpr double kLeastRadius = 1e-6;

/// The frame in which wrap and contraction work: centred, diagonal 1.
struct Frame {
  Vec3d centre;
  double diagonal = 0;
  Vec3d to_unit(Vec3f p) const { return (to_double(p) - centre) * (1 / diagonal); }
  Vec3d from_unit(Vec3d p) const { return p * diagonal + centre; }
};

Frame frame_of(const std::vector<Vec3f>& positions) {
  Vec3d lo = to_double(positions[0]), hi = lo;
  for (Vec3f p : positions)
    for (int k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], double{p[k]});
      hi[k] = std::max(hi[k], double{p[k]});
    }
  return {(lo + hi) * 0.5, length(hi - lo)};
}

std::vector<std::uint32_t> cluster(const std::vector<float>& points,
                                   const std::vector<std::uint32_t>& indices) {
  std::vector<std::uint32_t> fewer(indices.size());
  fewer.resize(meshopt_simplifySloppy(fewer.data(), indices.data(), indices.size(), points.data(),
                                      points.size() / 3, 3 * sizeof(float), kMaxSoup * 3, 1.0f, nullptr));
  return fewer;
}

/// The triangles that have an area, thinned out when there are many. Points that no triangle uses are left
/// out: the wrap's search tree would take them in.
TriangleSoup make_soup(const Mesh& mesh, const Frame& frame) {
  std::vector<float> points;
  for (Vec3f p : mesh.positions) {
    const Vec3d unit = frame.to_unit(p);
    for (int k = 0; k < 3; ++k) points.push_back(static_cast<float>(unit[k]));
  }
  std::vector<std::uint32_t> indices;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) indices.push_back(mesh.position_of(t, k));
  // Clustering may leave nothing of a soup of crumbs; then all of it is wrapped.
  if (indices.size() > kMaxSoup * 3)
    if (std::vector<std::uint32_t> fewer = cluster(points, indices); !fewer.empty())
      indices = std::move(fewer);

  TriangleSoup soup;
  std::vector<std::uint32_t> number(mesh.positions.size(), 0xffffffffu);
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
    const auto point = [&](std::size_t k) {
      const float* p = &points[3 * std::size_t{indices[i + k]}];
      return Vec3d{p[0], p[1], p[2]};
    };
    if (cross(point(1) - point(0), point(2) - point(0)) == Vec3d{}) continue;
    Triangle t{};
    for (std::size_t k = 0; k < 3; ++k) {
      std::uint32_t& n = number[indices[i + k]];
      if (n == 0xffffffffu) {
        n = static_cast<std::uint32_t>(soup.points.size());
        soup.points.push_back(point(k));
      }
      t[k] = n;
    }
    soup.triangles.push_back(t);
  }
  if (soup.triangles.empty()) throw std::runtime_error("no triangle has an area");
  return soup;
}

void append(const CurveSkeleton& part, CurveSkeleton& all) {
  const auto base = static_cast<std::uint32_t>(all.nodes.size());
  all.nodes.insert(all.nodes.end(), part.nodes.begin(), part.nodes.end());
  for (const auto& s : part.segments) all.segments.push_back({base + s[0], base + s[1]});
  // A part that contracted to a point has a node and no segment.
  if (part.segments.empty())
    for (std::uint32_t n = base; n < all.nodes.size(); ++n) all.segments.push_back({n, n});
}

CurveSkeleton contract_parts(const std::vector<TriangleSoup>& parts, const RunContext& context) {
  CurveSkeleton all;
  for (const TriangleSoup& part : parts) {
    context.check_cancelled();
    append(contract_to_skeleton(part), all);
  }
  for (const Vec3d& p : all.nodes)
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      throw std::runtime_error("a node is not finite");
  if (all.segments.empty()) throw std::runtime_error("the skeleton is empty");
  return all;
}

CurveSkeleton extract(const Mesh& mesh, const Frame& frame, const SkeletonizationOptions& options,
                      const RunContext& context) {
  const TriangleSoup soup = make_soup(mesh, frame);
  context.check_cancelled();
  const std::vector<TriangleSoup> parts =
      wrap_surface(soup, 1.0 / options.alpha_divisor, 1.0 / options.offset_divisor,
                   static_cast<std::size_t>(options.max_wrap_faces));
  context.report(0.7);
  CurveSkeleton skeleton = contract_parts(parts, context);
  for (Vec3d& p : skeleton.nodes) p = frame.from_unit(p);
  return skeleton;
}

std::vector<float> distances_to(const CurveSkeleton& skeleton, const std::vector<Vec3f>& positions,
                                const RunContext& context) {
  const SegmentTree tree(skeleton.nodes, skeleton.segments);
  std::vector<float> distance(positions.size());
  parallel_for(context, positions.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p)
      distance[p] = static_cast<float>(tree.distance(to_double(positions[p])));
  });
  return distance;
}

/// The mean of each component's positions; distances are to the own one, not to the closest.
void use_centroids(const ConditionedMesh& mesh, CurveSkeleton& skeleton, std::vector<float>& distance) {
  skeleton = {};
  skeleton.nodes.resize(mesh.component_count);
  std::vector<double> count(mesh.component_count, 0);
  const auto& positions = mesh.mesh.positions;
  for (std::size_t p = 0; p < positions.size(); ++p) {
    Vec3d& sum = skeleton.nodes[mesh.component[p]];
    sum = sum + to_double(positions[p]);
    ++count[mesh.component[p]];
  }
  for (std::uint32_t c = 0; c < mesh.component_count; ++c) {
    skeleton.nodes[c] = skeleton.nodes[c] * (1 / count[c]);
    skeleton.segments.push_back({c, c});
  }
  distance.resize(positions.size());
  for (std::size_t p = 0; p < positions.size(); ++p)
    distance[p] = static_cast<float>(length(to_double(positions[p]) - skeleton.nodes[mesh.component[p]]));
}

std::vector<float> floored(const std::vector<float>& distance, double floor, double diagonal) {
  std::vector<float> sorted = distance;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                   sorted.end());
  const auto least = static_cast<float>(std::max(floor * sorted[sorted.size() / 2], kLeastRadius * diagonal));
  std::vector<float> radius(distance.size());
  for (std::size_t p = 0; p < radius.size(); ++p) radius[p] = std::max(distance[p], least);
  return radius;
}

}  // namespace

Skeleton skeletonize(const ConditionedMesh& mesh, const SkeletonizationOptions& options,
                     const RunContext& context) {
  const Frame frame = frame_of(mesh.mesh.positions);
  Skeleton out;
  CurveSkeleton skeleton;
  try {
    skeleton = extract(mesh.mesh, frame, options, context);
    out.distance = distances_to(skeleton, mesh.mesh.positions, context);
  } catch (const Cancelled&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;  // a limit of the machine must not decide about the result
  } catch (const std::exception&) {
    use_centroids(mesh, skeleton, out.distance);
    out.fallback_centroid = true;
    add_warning(out.notes, "skeleton-fallback", "",
                "no skeleton, distances are to the centroids of the components");
  }
  for (const Vec3d& p : skeleton.nodes) out.nodes.push_back(to_float(p));
  out.segments = std::move(skeleton.segments);
  out.radius = floored(out.distance, options.radius_floor, frame.diagonal);
  context.report(1);
  return out;
}

}  // namespace texmesh
