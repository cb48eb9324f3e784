#include "tools/cli/check/atlas_gate.h"

#include <fmt/format.h>

#include "pipeline/io/table.h"

namespace texmesh {
namespace {

/// NaN breaks every limit.
void add_most(const std::string& what, double value, const std::optional<double>& most,
              std::vector<GateResult>& out) {
  if (!most) return;
  const bool kept = value <= *most;
  out.push_back(
      {what,
       kept ? "" : fmt::format("{}: {}, expected at most {}", what, shortest(value, 6), shortest(*most, 6))});
}

void add_least(const std::string& what, double value, const std::optional<double>& least,
               std::vector<GateResult>& out) {
  if (!least) return;
  const bool kept = value >= *least;
  out.push_back({what, kept ? ""
                            : fmt::format("{}: {}, expected at least {}", what, shortest(value, 6),
                                          shortest(*least, 6))});
}

}  // namespace

std::vector<GateResult> check_atlases(const AtlasDiagnosis& d, const AtlasLimits& limits) {
  std::vector<GateResult> out;
  add_most("charts", static_cast<double>(d.charts()), limits.max_charts, out);
  add_most("triangle floor", static_cast<double>(d.triangle_floor()), limits.max_floor_triangles, out);
  for (const NamedAtlas& a : d.atlases) {
    const std::string of = a.name + ": ";
    add_least(of + "cover", a.cover, limits.min_cover, out);
    add_most(of + "share of texels in thin charts", a.thin_share, limits.max_thin, out);
    add_most(of + "overlap", a.overlap, limits.max_overlap, out);
    add_most(of + "surface without area on the texture", a.flat_surface, limits.max_flat, out);
    add_most(of + "density spread", a.density_spread(), limits.max_density_spread, out);
    add_most(of + "stretch of 95 % of the surface", a.stretch.p95, limits.max_stretch, out);
    if (a.seam_colours)
      add_most(of + "colour difference across seams", a.seam_colours->mean, limits.max_seam_difference, out);
  }
  return out;
}

}  // namespace texmesh
