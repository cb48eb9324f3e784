#include <algorithm>
#include <cmath>

#include "format/container/layout.h"
#include "format/rules/allocation.h"
#include "pipeline/io/text_table.h"
#include "tools/inspect/verify/verify_checks.h"

namespace texmesh {
namespace {

/// Of a scale that is stored everything follows from tables.bin.
void check_gamma_table(const Manifest& m, const PlaneTables& t, const PlaneThesis& thesis,
                       const std::string& place, Findings& findings) {
  for (std::size_t row = 0; row < m.scales.size(); ++row) {
    const auto s = static_cast<std::size_t>(m.scales[row].scale);
    const std::string scale = std::to_string(s);
    if (!findings.require(s < thesis.quality.size(), {"thesis", "R16"}, kThesisPath, place + "scale " + scale,
                          "Q_i and D_i", "none"))
      return;
    findings.require_equal(t.quality[row], thesis.quality[s], {"thesis", "O06"}, kThesisPath,
                           place + "Q_" + scale);
    for (std::size_t g = 0; g < kGammaSteps; ++g) {
      const double gamma = static_cast<double>(g) / (kGammaSteps - 1);
      findings.require_equal(bytes_asked_for(t, row, gamma), thesis.total_bytes[s * kGammaSteps + g],
                             {"thesis", "O06"}, kThesisPath,
                             place + "D_" + scale + "(" + fixed(gamma, 2) + ")");
    }
  }
}

/// Scales that are stored stand in the table with the p95 of the manifest, whose figures have six digits.
void check_perceptual(const Manifest& m, const PerceptualTable& table, Findings& findings) {
  for (const ManifestScale& s : m.scales) {
    const auto at = std::ranges::find(table.scale, s.scale);
    const std::string scale = "scale " + std::to_string(s.scale);
    if (!findings.require(at != table.scale.end(), {"thesis", "R16"}, kThesisPath, "perceptual table", scale,
                          "none"))
      return;
    const auto row = static_cast<std::size_t>(at - table.scale.begin());
    if (row == 0) continue;
    const auto p95 = static_cast<double>(table.p95[pair_index(table.scale.size(), 0, row)]);
    findings.require(std::abs(p95 - s.p95) <= 1e-5 * s.p95, {"thesis", "O06"}, kThesisPath, scale + ", p95",
                     std::to_string(s.p95), std::to_string(p95));
  }
}

}  // namespace

void check_thesis(const Manifest& m, const PackageTables& tables, const ThesisTables& thesis,
                  Findings& findings) {
  if (!thesis.perceptual.empty()) check_perceptual(m, thesis.perceptual, findings);
  for (std::size_t p = 0; p < thesis.planes.size(); ++p) {
    const PlaneThesis& plane = thesis.planes[p];
    const std::string place = "plane " + std::to_string(p) + ", ";
    if (!findings.require(p < tables.planes.size(), {"thesis", "R16"}, kThesisPath, place,
                          "a plane of the package", "none"))
      return;
    const PlaneTables& t = tables.planes[p];
    if (!plane.z.empty())
      findings.require_equal<std::uint64_t>(t.fragment_count(), plane.z.size(), {"thesis", "R16"},
                                            kThesisPath, place + "fragments");
    if (!plane.models.empty())
      findings.require_equal<std::uint64_t>(t.fragment_count(), plane.models.size(), {"thesis", "R16"},
                                            kThesisPath, place + "size models");
    if (!plane.quality.empty() && t.scale_count() == m.scales.size())
      check_gamma_table(m, t, plane, place, findings);
  }
}

}  // namespace texmesh
