#include "stages/skeletonization/skeletonization.h"

#include "stages/base/parallel.h"
#include "stages/skeletonization/curve_skeleton.h"

namespace texmesh {
namespace {

/// No radius is smaller than this fraction of the diagonal, since R is a divisor.
constexpr double kLeastRadius = 1e-6;
/// Thin parts are noted from this share of the vertices on.
constexpr double kWorthANote = 0.01;
constexpr int kWrapAttempts = 3;

void append(const CurveSkeleton& part, CurveSkeleton& all) {
  const auto base = static_cast<std::uint32_t>(all.nodes.size());
  all.nodes.insert(all.nodes.end(), part.nodes.begin(), part.nodes.end());
  for (const auto& s : part.segments) all.segments.push_back({base + s[0], base + s[1]});
  // A part that contracted to a point has a node and no segment.
  if (part.segments.empty())
    for (std::uint32_t n = base; n < all.nodes.size(); ++n) all.segments.push_back({n, n});
}

bool is_finite(const CurveSkeleton& skeleton) {
  return !skeleton.nodes.empty() && std::all_of(skeleton.nodes.begin(), skeleton.nodes.end(), [](Vec3d p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
  });
}

CurveSkeleton centroid_of(const TriangleSoup& part) {
  Vec3d sum;
  for (const Vec3d& p : part.points) sum = sum + p;
  return {{sum * (1 / static_cast<double>(part.points.size()))}, {}};
}

CurveSkeleton contract_parts(const std::vector<TriangleSoup>& parts, int max_contractions, Notes& notes,
                             const RunContext& context) {
  CurveSkeleton all;
  std::size_t failed = 0;
  for (const TriangleSoup& part : parts) {
    context.check_cancelled();
    CurveSkeleton skeleton;
    try_geometry([&] { skeleton = contract_to_skeleton(part, max_contractions); }, [&] { skeleton = {}; });
    if (!is_finite(skeleton)) {
      skeleton = centroid_of(part);
      ++failed;
    }
    append(skeleton, all);
  }
  if (failed > 0)
    add_warning(notes, "skeleton-part-centroid", "",
                std::to_string(failed) + " of " + std::to_string(parts.size()) +
                    " parts cannot be contracted to a curve, their centroids take its place");
  return all;
}

/// What a wrap need not be finer than.
struct WrapSize {
  double alpha = 0;
  std::size_t faces = 0;
  bool is_coarsest = false;
};
/// A mesh of 6,400 triangles has edges of about alpha, and a wrap of shorter ones shows no more of it.
/// Smaller models come in thousands, so below that the wrap gets coarser faster than the mesh.
WrapSize wrap_size(const SkeletonizationOptions& options, std::size_t triangles) {
  constexpr std::size_t kLeastFaces = 1000;
  constexpr double kLeastDivisor = 24, kDivisor = 80, kTriangles = 6400, kCubeOfOneFace = 8e6;
  const auto count = static_cast<double>(triangles), part = count / kTriangles;
  const double divisor = std::max(kLeastDivisor, kDivisor * part * std::sqrt(part));
  const double faces = std::min<double>(options.max_wrap_faces, count * count * count / kCubeOfOneFace);
  return {1 / std::min<double>(options.alpha_divisor, divisor),
          std::max(std::min<std::size_t>(kLeastFaces, static_cast<std::size_t>(options.max_wrap_faces)),
                   static_cast<std::size_t>(faces)),
          divisor == kLeastDivisor};
}

/// The closed surface that is contracted, and what it is contracted to.
struct ContractedSurface {
  std::vector<TriangleSoup> parts;
  CurveSkeleton skeleton;
  double offset = 0;  // how far it stands off the shape
};

/// Of the mesh itself, where that is a closed surface of few but small triangles; else nothing. R comes
/// nearer to that of a fine wrap than R of the coarsest one: over six scans and six made models of 1,200 to
/// 2,400 triangles it differs by 2 to 47 %, mean 17, that of the coarsest wrap by 3 to 107, mean 26.
ContractedSurface contract_mesh(const TriangleSoup& soup, const WrapSize& size,
                                const SkeletonizationOptions& options) {
  constexpr std::size_t kLeastTriangles = 1000;
  constexpr double kLongestEdge = 0.25;
  ContractedSurface out;
  if (!size.is_coarsest || soup.triangles.size() < kLeastTriangles || !is_closed_surface(soup, kLongestEdge))
    return out;
  try_geometry(
      [&] {
        out.parts = {decimate_evenly(soup, size.faces)};
        out.skeleton = contract_to_skeleton(out.parts.front(), options.max_contractions);
      },
      [&] { out = {}; });
  return is_finite(out.skeleton) ? out : ContractedSurface{};
}

/// The wrap at the finest alpha at which it ends within the cap.
std::vector<TriangleSoup> wrap(const TriangleSoup& soup, const WrapSize& size,
                               const SkeletonizationOptions& options, Notes& notes,
                               const RunContext& context) {
  const auto divisor = [](double of) { return std::to_string(std::lround(1 / of)); };
  double alpha = size.alpha;
  for (int attempt = 1;; ++attempt, alpha *= 2) {
    context.check_cancelled();
    std::vector<TriangleSoup> parts;
    try_geometry(
        [&] {
          parts = wrap_surface(soup, alpha, 1.0 / options.offset_divisor, size.faces,
                               static_cast<std::size_t>(options.max_wrap_steps), context);
        },
        [&] {
          if (attempt == kWrapAttempts) throw;
        });
    if (parts.empty() && attempt == kWrapAttempts) throw GeometryFailure("the wrap is empty");
    if (parts.empty()) continue;
    if (attempt > 1)
      add_warning(notes, "skeleton-coarser-wrap", "",
                  "the surface is too intricate for alpha_divisor " + divisor(size.alpha) +
                      ", wrapped with " + divisor(alpha));
    return parts;
  }
}

std::vector<double> distances_to(const CurveSkeleton& skeleton, const std::vector<Vec3d>& points,
                                 const RunContext& context) {
  const SegmentTree tree(skeleton.nodes, skeleton.segments);
  std::vector<double> distance(points.size());
  parallel_each(context, points.size(), 1024, [&](std::size_t p) { distance[p] = tree.distance(points[p]); });
  return distance;
}

void note_limits(const LocalRadius& local, Notes& notes) {
  if (local.plates > 0)
    add_info(notes, "skeleton-plates", "",
             std::to_string(local.plates) + " of " + std::to_string(local.parts) +
                 " parts are plates, where R is half the local thickness");
  const auto count = static_cast<double>(local.radius.size());
  if (local.plates < local.parts && static_cast<double>(local.limited) >= kWorthANote * count)
    add_info(notes, "skeleton-thin-parts", "",
             "R is bounded by the local thickness at " +
                 std::to_string(static_cast<int>(100 * static_cast<double>(local.limited) / count + 0.5)) +
                 " % of the vertices, which the skeleton does not reach");
}

/// Skeleton and R of a mesh. They are computed in the unit frame and then scaled back.
CurveSkeleton extract(const ConditionedMesh& mesh, const UnitFrame& frame,
                      const SkeletonizationOptions& options, const RunContext& context,
                      std::vector<float>& distance, Notes& notes) {
  const TriangleSoup soup = make_wrap_soup(mesh, frame);
  const WrapSize size = wrap_size(options, mesh.mesh.triangles.size());
  auto [parts, skeleton, offset] = contract_mesh(soup, size, options);
  if (parts.empty()) {
    parts = wrap(soup, size, options, notes, context);
    context.report(0.7);
    skeleton = contract_parts(parts, options.max_contractions, notes, context);
    offset = 1.0 / options.offset_divisor;
  }
  context.report(0.8);
  std::vector<Vec3d> points;
  points.reserve(mesh.mesh.positions.size());
  for (Vec3f p : mesh.mesh.positions) points.push_back(frame.to_unit(p));
  const std::vector<double> far = distances_to(skeleton, points, context);
  const LocalRadius local =
      limit_by_thickness(parts, points, far, {options.plate_ratio, options.limb_ratio, offset}, context);
  note_limits(local, notes);
  for (double r : local.radius) distance.push_back(static_cast<float>(r * frame.diagonal));
  for (Vec3d& p : skeleton.nodes) p = frame.from_unit(p);
  return skeleton;
}

/// The fallback: the skeleton is the centroid of each component, and a position's distance is that to the
/// centroid of its own component, not to the closest one.
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
  const UnitFrame frame = unit_frame_of(mesh.mesh.positions);
  Skeleton out;
  CurveSkeleton skeleton;
  try_geometry([&] { skeleton = extract(mesh, frame, options, context, out.distance, out.notes); },
               [&] {
                 use_centroids(mesh, skeleton, out.distance);
                 out.fallback_centroid = true;
                 add_warning(out.notes, "skeleton-fallback", "",
                             "no skeleton, distances are to the centroids of the components");
               });
  for (const Vec3d& p : skeleton.nodes) out.nodes.push_back(to_float(p));
  out.segments = std::move(skeleton.segments);
  out.radius = floored(out.distance, options.radius_floor, frame.diagonal);
  context.report(1);
  return out;
}

}  // namespace texmesh
