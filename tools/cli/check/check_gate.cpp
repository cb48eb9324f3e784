#include "tools/cli/check/check_gate.h"

#include <fmt/format.h>

#include "format/base/text_bytes.h"
#include "pipeline/batch/fleet/run_summary.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/table.h"
#include "tools/cli/options/delivery_options.h"
#include "tools/publish/report/report_pictures.h"

namespace texmesh {
namespace {

/// NaN breaks every limit.
void add_limit(const std::string& what, double value, const std::optional<double>& limit, bool is_most,
               std::vector<GateResult>& out) {
  if (!limit) return;
  const bool kept = is_most ? value <= *limit : value >= *limit;
  out.push_back({what, kept ? ""
                            : fmt::format("{}: {}, expected at {} {}", what, shortest(value, 6),
                                          is_most ? "most" : "least", shortest(*limit, 6))});
}

}  // namespace

std::vector<GateResult> check_plan(const DeliveryPlan& plan, const Gate& gate, double time_limit_s) {
  std::vector<GateResult> results;
  const auto add = [&](std::string name, bool good, std::string failure) {
    results.push_back({std::move(name), good ? "" : std::move(failure)});
  };
  add("predicted FLIP", plan.flip <= gate.max_flip,
      fmt::format("predicted FLIP {:.4f}, expected at most {:.4f}", plan.flip, gate.max_flip));
  add("predicted FLIP by the textures alone", plan.texture_flip <= gate.max_texture_flip,
      fmt::format("predicted FLIP by the textures alone {:.4f}, expected at most {:.4f}", plan.texture_flip,
                  gate.max_texture_flip));
  add("time of the first picture", plan.first_picture_s <= gate.max_first_picture_s,
      fmt::format("first picture {}, expected by {:.2f} s", moment(plan.first_picture_s),
                  gate.max_first_picture_s));
  add("time of all", plan.complete_s <= 1.01 * time_limit_s,
      fmt::format("complete {}, expected by {:.2f} s", moment(plan.complete_s), time_limit_s));
  add("bytes", plan.bytes() <= gate.max_bytes,
      fmt::format("{} bytes, expected at most {}", grouped(plan.bytes()), grouped(gate.max_bytes)));
  return results;
}

std::vector<GateResult> check_switch_sizes(PackageReader& package, double max_flip, int views,
                                           const RunContext& context) {
  std::vector<GateResult> results;
  const bool any =
      std::ranges::any_of(package.manifest().steps, [](const ManifestStep& s) { return s.scale > 0; });
  if (!any) return results;
  PackagePictures pictures(package, {}, context);
  for (const SwitchSize& s : measure_switch_sizes(package, pictures, views, context)) {
    const double flip = s.views.worst_mean();
    results.push_back({fmt::format("FLIP of S_{} at its switch size", s.scale),
                       flip <= max_flip
                           ? ""
                           : fmt::format("S_{} at {:.0f} px: measured FLIP {:.4f} in the worst of {} views, "
                                         "expected at most {:.4f}",
                                         s.scale, s.rendered_px, flip, views, max_flip)});
  }
  return results;
}

std::vector<GateResult> check_atlases(const AtlasDiagnosis& d, const AtlasLimits& limits) {
  std::vector<GateResult> out;
  const auto add_most = [&](const std::string& what, double value, const std::optional<double>& most) {
    add_limit(what, value, most, true, out);
  };
  add_most("charts", static_cast<double>(d.charts()), limits.max_charts);
  add_most("triangle floor", static_cast<double>(d.triangle_floor()), limits.max_floor_triangles);
  for (const NamedAtlas& a : d.atlases) {
    const std::string of = a.name + ": ";
    add_limit(of + "cover", a.cover, limits.min_cover, false, out);
    add_most(of + "share of texels in thin charts", a.thin_share, limits.max_thin);
    add_most(of + "overlap", a.overlap, limits.max_overlap);
    add_most(of + "surface without area on the texture", a.flat_surface, limits.max_flat);
    add_most(of + "density spread", a.density_spread(), limits.max_density_spread);
    add_most(of + "stretch of 95 % of the surface", a.stretch.p95, limits.max_stretch);
    if (a.seam_colours)
      add_most(of + "colour difference across seams", a.seam_colours->mean, limits.max_seam_difference);
  }
  return out;
}

std::string gate_junit(const std::string& suite, const std::string& input,
                       const std::vector<GateResult>& results) {
  const auto failures =
      std::ranges::count_if(results, [](const GateResult& r) { return !r.failure.empty(); });
  JunitReport report({suite, results.size(), static_cast<std::size_t>(failures), 0, {}});
  for (const GateResult& r : results) report.add({printable(input), r.name, {}, {}, r.failure, "", ""});
  return report.finish();
}

void write_gate_junit(const std::string& path, const std::string& suite, const std::string& input,
                      const std::vector<GateResult>& results) {
  if (!path.empty()) write_output_file(path, text_bytes(gate_junit(suite, input, results)));
}

std::vector<std::string> gate_failures(const std::vector<GateResult>& results) {
  std::vector<std::string> out;
  for (const GateResult& r : results)
    if (!r.failure.empty()) out.push_back(r.failure);
  return out;
}

std::string gate_text(const std::vector<GateResult>& results) {
  std::string out;
  for (const std::string& r : gate_failures(results)) out += "not good enough: " + r + "\n";
  return out.empty() && !results.empty() ? "good enough\n" : out;
}

}  // namespace texmesh
