#include "stages/skeletonization/local_radius.h"

#include <algorithm>
#include <limits>

#include "stages/base/parallel.h"
#include "stages/geometry/triangle_tree.h"
#include "stages/skeletonization/shape_thickness.h"

namespace texmesh {
namespace {

/// What the wrap says at a point.
struct Local {
  double half = 0;    // half thickness of the shape
  double weight = 0;  // 0 = a sheet, 1 = a solid
  std::uint32_t part = 0;
};

struct JoinedParts {
  TriangleSoup soup;
  std::vector<std::uint32_t> part;  // per triangle
};

JoinedParts join(const std::vector<TriangleSoup>& parts) {
  JoinedParts all;
  for (std::uint32_t i = 0; i < parts.size(); ++i) {
    const auto base = static_cast<std::uint32_t>(all.soup.points.size());
    all.soup.points.insert(all.soup.points.end(), parts[i].points.begin(), parts[i].points.end());
    for (const Triangle& t : parts[i].triangles) {
      all.soup.triangles.push_back({base + t[0], base + t[1], base + t[2]});
      all.part.push_back(i);
    }
  }
  return all;
}

std::vector<Local> nearest_parts(const JoinedParts& wrap, std::span<const Vec3d> points, double offset,
                                 const RunContext& context) {
  const TriangleTree tree(wrap.soup.points, wrap.soup.triangles);
  const std::vector<double> thickness = half_thickness(wrap.soup, tree, context);
  std::vector<Local> local(points.size());
  parallel_for(context, points.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      const TriangleTree::Nearest at = tree.nearest(points[p]);
      double half = 0;
      for (std::size_t k = 0; k < 3; ++k)
        if (at.weight[k] > 0) half += at.weight[k] * thickness[wrap.soup.triangles[at.triangle][k]];
      local[p].part = wrap.part[at.triangle];
      local[p].half = std::max(half - offset, 0.0);
      local[p].weight = std::clamp(local[p].half / offset - 0.5, 0.0, 1.0);
    }
  });
  return local;
}

enum class PartKind : std::uint8_t { kSolid, kPlate, kSheet };
/// Share of a part's points that must lie on a solid for its thickness to be that of a shape: scans that are
/// open sheets with some folds have walls all over their wrap, and R would jump between them.
constexpr double kSolidShare = 0.75;

std::vector<PartKind> sort_parts(const std::vector<Local>& local, std::span<const double> distance,
                                 std::size_t parts, double plate_ratio) {
  std::vector<std::vector<double>> ratio(parts);
  std::vector<std::size_t> count(parts, 0);
  for (std::size_t p = 0; p < local.size(); ++p) {
    ++count[local[p].part];
    if (local[p].weight == 1 && local[p].half < std::numeric_limits<double>::infinity())
      ratio[local[p].part].push_back(distance[p] / local[p].half);
  }
  std::vector<PartKind> kind(parts, PartKind::kSheet);
  for (std::size_t i = 0; i < parts; ++i) {
    if (ratio[i].empty() ||
        static_cast<double>(ratio[i].size()) < kSolidShare * static_cast<double>(count[i]))
      continue;
    const auto middle = ratio[i].begin() + static_cast<std::ptrdiff_t>(ratio[i].size() / 2);
    std::nth_element(ratio[i].begin(), middle, ratio[i].end());
    kind[i] = *middle > plate_ratio ? PartKind::kPlate : PartKind::kSolid;
  }
  return kind;
}

}  // namespace

LocalRadius limit_by_thickness(const std::vector<TriangleSoup>& parts, std::span<const Vec3d> points,
                               std::span<const double> distance, const LocalRadiusOptions& options,
                               const RunContext& context) {
  const std::vector<Local> local = nearest_parts(join(parts), points, options.offset, context);
  const std::vector<PartKind> kind = sort_parts(local, distance, parts.size(), options.plate_ratio);
  LocalRadius out;
  out.parts = parts.size();
  out.plates = static_cast<std::size_t>(std::count(kind.begin(), kind.end(), PartKind::kPlate));
  out.radius.resize(points.size());
  for (std::size_t p = 0; p < points.size(); ++p) {
    const Local& at = local[p];
    out.radius[p] = distance[p];
    if (kind[at.part] == PartKind::kSheet || at.weight == 0) continue;
    const double most = kind[at.part] == PartKind::kPlate ? at.half : options.limb_ratio * at.half;
    out.radius[p] -= at.weight * std::max(distance[p] - most, 0.0);
    out.limited += out.radius[p] < distance[p];
  }
  return out;
}

}  // namespace texmesh
