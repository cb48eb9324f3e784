#include "stages/proxies/surface/simplify_surface.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "format/base/box.h"
#include "stages/proxies/surface/clean_soup.h"
#include "stages/proxies/surface/surface_collapse.h"

namespace texmesh {
namespace {

/// Places in a box of side 1 around 0, where squares of squares neither overflow nor vanish.
struct UnitFrame {
  Vec3d centre;
  double side = 1;
  explicit UnitFrame(const std::vector<Vec3f>& positions) {
    const Box3d box = to_double(bounding_box(positions));
    if (box.empty()) return;
    centre = box.centre();
    if (box.longest_side() > 0) side = box.longest_side();
  }
  std::vector<Vec3d> places(const std::vector<Vec3f>& positions) const {
    std::vector<Vec3d> out;
    out.reserve(positions.size());
    for (const Vec3f p : positions) out.push_back((to_double(p) - centre) * (1 / side));
    return out;
  }
  Vec3f position(Vec3d place) const { return to_float(place * side + centre); }
};

ProxySurface snapshot(const SurfaceCollapse& collapse, const UnitFrame& frame,
                      const std::vector<std::uint32_t>& source_group) {
  std::vector<Vec3f> positions;
  positions.reserve(collapse.places().size());
  for (const Vec3d& p : collapse.places()) positions.push_back(frame.position(p));
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> group;
  const CornerRings& rings = collapse.rings();
  for (std::uint32_t t = 0; t < rings.triangles().size(); ++t) {
    if (!rings.is_live(t)) continue;
    triangles.push_back(rings.triangles()[t]);
    group.push_back(source_group[t]);
  }
  return clean_soup(positions, triangles, group, ZeroArea::kDrop);
}

/// An edge's length at the sizes asked for: what a border's move by as much would take from the picture.
double typical_edge(double area, std::span<const std::uint32_t> triangle_counts) {
  if (triangle_counts.empty()) return 0;
  const double middle = std::sqrt(1.0 * triangle_counts.front() * triangle_counts.back());
  return std::sqrt(area / std::max(middle, 1.0));
}

}  // namespace

std::vector<ProxySurface> simplify_surface(std::span<const Vec3f> positions,
                                           std::span<const Triangle> triangles,
                                           std::span<const std::uint32_t> group,
                                           std::span<const std::uint32_t> triangle_counts,
                                           const RunContext& context) {
  ProxySurface soup = clean_soup(positions, triangles, group, ZeroArea::kKeep);
  const UnitFrame frame(soup.positions);
  std::vector<Vec3d> places = frame.places(soup.positions);
  const double border_width = typical_edge(area_of(places, soup.triangles), triangle_counts);
  SurfaceCollapse collapse(std::move(places), std::move(soup.triangles), soup.group, border_width);
  std::vector<ProxySurface> surfaces;
  for (const std::uint32_t count : triangle_counts) {
    collapse.run(std::max(count, 1u), context);
    surfaces.push_back(snapshot(collapse, frame, soup.group));
  }
  return surfaces;
}

}  // namespace texmesh
