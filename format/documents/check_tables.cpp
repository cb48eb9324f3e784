#include "format/documents/check_tables.h"

#include "format/base/rule_error.h"
#include "format/container/layout.h"

namespace texmesh {

void fail_tables(const char* rule, const std::string& place, const std::string& expected,
                 const std::string& found) {
  throw RuleError(rule, kTablesPath, place, expected, found);
}

void require_tables(bool good, const char* rule, const std::string& place, const char* expected,
                    const std::string& found) {
  if (!good) fail_tables(rule, place, expected, found);
}

std::uint64_t cells_of(std::uint64_t fragments, std::uint64_t rungs, std::uint64_t scales) {
  return fragments * (5 * rungs + scales);
}

std::uint64_t cells_of(const PlaneTables& t) {
  return cells_of(t.fragment_count(), t.rung_count(), t.scale_count());
}

namespace {

constexpr std::uint32_t kFeatureLimit = 1u << 24;
constexpr float kLargestMse = 65025, kLargestDssim = 2;

template <class T>
void require_count(const std::vector<T>& values, std::size_t count, const std::string& place) {
  if (values.size() != count)
    fail_tables("T03", place, std::to_string(count) + " values", std::to_string(values.size()));
}

void require_range(const std::vector<float>& values, float lo, float hi, const std::string& place) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!(values[i] >= lo && values[i] <= hi))
      fail_tables("T04", place + "[" + std::to_string(i) + "]",
                  std::to_string(lo) + " to " + std::to_string(hi), std::to_string(values[i]));
}

void check_counts(const PlaneTables& t, const std::string& place) {
  const std::size_t f = t.fragment_count(), r = t.rung_count(), n = t.scale_count();
  require_count(t.table_bytes, r, place + "/table_bytes");
  require_count(t.size_bytes, r * f, place + "/size_bytes");
  require_count(t.digest, r * f, place + "/digest");
  require_count(t.mse, r * f, place + "/mse");
  require_count(t.dssim, r * f, place + "/dssim");
  require_count(t.skip_dssim, f, place + "/skip_dssim");
  require_count(t.covered_texels, f, place + "/covered_texels");
  require_count(t.surface_fraction, f, place + "/surface_fraction");
  require_count(t.features, n * f, place + "/features");
  require_count(t.vqp, t.allocation == kByVqp ? f : 0, place + "/vqp");
}

void check_shape(const PlaneTables& t, const std::string& place) {
  require_tables(
      t.columns >= 1 && t.rows >= 1 && t.columns <= kMaxFragments && t.rows <= kMaxFragments / t.columns,
      "T03", place + "/columns,rows", "1 to 65535 fragments",
      std::to_string(t.columns) + " x " + std::to_string(t.rows));
  require_tables(t.scale_count() >= 1 && t.scale_count() <= kMaxScaleCount, "T03", place + "/quality",
                 "1 to 100 scales", std::to_string(t.scale_count()));
  require_tables(!t.rung_quality.empty() && t.rung_quality.size() <= kMaxPackageRungs, "T03",
                 place + "/rung_quality", "1 to 100 rungs", std::to_string(t.rung_quality.size()));
  require_tables(cells_of(t) <= kMaxPlaneCells, "L02", place, "at most 2^24 cells",
                 std::to_string(cells_of(t)));
  for (std::size_t r = 0; r < t.rung_count(); ++r)
    require_tables(t.rung_quality[r] >= 1 && t.rung_quality[r] <= 100 &&
                       (r == 0 || t.rung_quality[r] > t.rung_quality[r - 1]),
                   "T08", place + "/rung_quality", "1 to 100, strictly rising",
                   std::to_string(t.rung_quality[r]));
}

void check_parameters(const PlaneTables& t, const std::string& place) {
  require_tables(t.allocation <= kByVqp, "T13", place + "/allocation", "0 to 3",
                 std::to_string(t.allocation));
  require_range({t.quality_width}, 0, 100, place + "/quality_width");
  require_range({t.log_width}, 0, 4, place + "/log_width");
  require_range({t.quality_max}, 1, 100, place + "/quality_max");
  require_range({t.quality_min}, 1, t.quality_max, place + "/quality_min");
}

/// Each stored fragment stands in the order once and has bytes at every rung; others have none, and no
/// covered texels. No message is put together for what is right: few bytes can claim 2^24 cells.
void check_fragment_order(const PlaneTables& t, const std::string& place) {
  const std::size_t fragments = t.fragment_count();
  std::vector<bool> listed(fragments, false);
  for (const std::uint16_t f : t.order) {
    if (f >= fragments || listed[f])
      fail_tables("T05", place + "/order", "every stored fragment once", std::to_string(f));
    listed[f] = true;
  }
  for (std::size_t k = 0; k < t.size_bytes.size(); ++k)
    if (listed[k % fragments] != (t.size_bytes[k] > 0))
      fail_tables("T06", place + "/size_bytes",
                  "bytes at every rung for the fragments in the order and for no others",
                  "fragment " + std::to_string(k % fragments) + " with " + std::to_string(t.size_bytes[k]));
  for (std::size_t f = 0; f < fragments; ++f)
    if (!listed[f] && t.covered_texels[f] != 0)
      fail_tables("T07", place + "/covered_texels", "0 where nothing is stored",
                  std::to_string(t.covered_texels[f]));
}

/// Each knot lies between two rungs, further on than the one before.
void check_knots(const PlaneTables& t, const std::string& place) {
  require_count(t.knot_position, t.knot_quality.size(), place + "/knot_position");
  require_range(t.knot_position, 0, 1, place + "/knot_position");
  std::size_t above = 0;  // rung
  for (std::size_t k = 0; k < t.knot_quality.size(); ++k) {
    const std::uint8_t q = t.knot_quality[k];
    const bool rises = k == 0 || q > t.knot_quality[k - 1];
    const std::size_t before = above;
    while (above < t.rung_count() && t.rung_quality[above] < q) ++above;
    require_tables(rises && above > 0 && above < t.rung_count() && t.rung_quality[above] != q, "T08",
                   place + "/knot_quality", "strictly rising, between rungs", std::to_string(q));
    require_tables(k == 0 || above != before || t.knot_position[k] >= t.knot_position[k - 1], "T08",
                   place + "/knot_position", "not falling between two rungs",
                   std::to_string(t.knot_position[k]));
  }
}

}  // namespace

void check_plane(const PlaneTables& t, float rounding, const std::string& place) {
  check_shape(t, place);
  check_counts(t, place);
  check_parameters(t, place);
  require_range(t.mse, 0, kLargestMse, place + "/mse");
  require_range(t.dssim, -rounding, kLargestDssim, place + "/dssim");
  require_range(t.skip_dssim, -rounding, kLargestDssim, place + "/skip_dssim");
  require_tables(t.knot_quality.size() < 256, "T03", place + "/knot_quality", "at most 255 knots", "more");
  check_knots(t, place);
  require_range(t.surface_fraction, 0, 1 + rounding, place + "/surface_fraction");
  require_range(t.quality, 0, 100, place + "/quality");
  require_range(t.vqp, 0, 1, place + "/vqp");
  for (const std::uint32_t f : t.features)
    if (f >= kFeatureLimit) fail_tables("T03", place + "/features", "less than 2^24", std::to_string(f));
  check_fragment_order(t, place);
}

}  // namespace texmesh
