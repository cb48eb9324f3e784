#include "format/rules/allocation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "format/base/portable_math.h"
#include "format/documents/tables.h"
#include "format/rules/rate_distortion.h"

// Thesis 3.2-3.3: from feature counts to the quality that a fragment is asked to have.

namespace texmesh {
namespace {

/// IJG's scale of the quantisers for a quality (1 = the tables of the standard), not under 0.01 so that its
/// logarithm exists at quality 100.
double ijg_scale(double quality) {
  const double q = std::clamp(quality, 1.0, 100.0);
  return std::max(q < 50 ? 50 / q : 2 - q / 50, 0.01);
}

double quality_of_scale(double scale) { return scale > 1 ? 50 / scale : 100 - 50 * scale; }

}  // namespace

double log_quantiser(double quality) { return -portable::log(ijg_scale(quality)); }

std::vector<float> eta_of(const PlaneTables& tables, std::size_t row) {
  if (tables.allocation == kByVqp) return tables.vqp;
  const std::size_t n = tables.fragment_count();
  const std::uint32_t* features = tables.features.data() + row * n;
  std::uint32_t lo = 0xffffffffu, hi = 0;
  for (std::size_t f = 0; f < n; ++f) {
    if (tables.covered_texels[f] == 0) continue;
    lo = std::min(lo, features[f]);
    hi = std::max(hi, features[f]);
  }
  std::vector<float> eta(n, 0.0f);
  if (hi <= lo) return eta;  // equal everywhere: nobody is asked for more than the mean
  for (std::size_t f = 0; f < n; ++f)
    if (tables.covered_texels[f] > 0)
      eta[f] = static_cast<float>(static_cast<double>(features[f] - lo) / static_cast<double>(hi - lo));
  return eta;
}

double mean_eta(const PlaneTables& tables, std::size_t row) {
  const std::vector<float> eta = eta_of(tables, row);
  double sum = 0;
  std::size_t covered = 0;
  for (std::size_t f = 0; f < eta.size(); ++f) {
    if (tables.covered_texels[f] == 0) continue;
    sum += static_cast<double>(eta[f]);
    ++covered;
  }
  return covered > 0 ? sum / static_cast<double>(covered) : 0;
}

std::vector<float> quality_of(const PlaneTables& tables, std::size_t row, double gamma) {
  std::vector<float> result = eta_of(tables, row);
  const double middle = static_cast<double>(tables.quality[row]);
  const double g = log_quantiser(middle);
  for (float& value : result) {
    const double away = static_cast<double>(value) - gamma;
    const double q =
        tables.allocation == 0 || tables.allocation == kByVqp
            ? middle + away * static_cast<double>(tables.quality_width)
            : quality_of_scale(portable::exp(-(g + away * static_cast<double>(tables.log_width))));
    value = std::clamp(static_cast<float>(q), tables.quality_min, tables.quality_max);
  }
  return result;
}

std::uint32_t nearest_rung(const PlaneTables& tables, double quality) {
  const double g = log_quantiser(quality);
  std::uint32_t best = 0;
  double best_distance = std::numeric_limits<double>::infinity();
  for (std::uint32_t r = 0; r < tables.rung_count(); ++r) {
    const double distance = std::fabs(log_quantiser(tables.rung_quality[r]) - g);
    if (distance < best_distance) {
      best = r;
      best_distance = distance;
    }
  }
  return best;
}

std::uint64_t bytes_asked_for(const PlaneTables& tables, std::size_t row, double gamma) {
  const std::vector<float> quality = quality_of(tables, row, gamma);
  std::uint64_t sum = 0;
  for (const std::uint16_t f : tables.order)
    sum += bytes_to_show(tables, nearest_rung(tables, static_cast<double>(quality[f])), f);
  return sum;
}

std::vector<std::int16_t> rungs_of(const PlaneTables& tables, std::size_t row, double gamma) {
  const std::vector<float> quality = quality_of(tables, row, gamma);
  std::vector<std::int16_t> rungs(tables.fragment_count(), kSkipped);
  for (const std::uint16_t f : tables.order)
    rungs[f] = static_cast<std::int16_t>(nearest_rung(tables, static_cast<double>(quality[f])));
  return tables.allocation != 2 ? rungs : allocate_rd(tables, sum_of(bytes_of(tables, rungs)));
}

std::vector<std::uint32_t> bytes_of(const PlaneTables& tables, const std::vector<std::int16_t>& rungs) {
  std::vector<std::uint32_t> bytes(tables.fragment_count(), 0);
  for (std::size_t f = 0; f < bytes.size(); ++f)
    if (rungs[f] != kSkipped)
      bytes[f] = static_cast<std::uint32_t>(bytes_to_show(tables, static_cast<std::size_t>(rungs[f]), f));
  return bytes;
}

std::uint64_t bytes_to_show(const PlaneTables& tables, std::size_t rung, std::size_t fragment) {
  const std::size_t fragments = tables.fragment_count();
  const std::uint64_t stream_bytes = tables.size_bytes[rung * fragments + fragment];
  if (!tables.incremental || stream_bytes == 0) return stream_bytes;
  std::uint64_t bytes = 0;
  for (std::size_t r = 0; r <= rung; ++r) bytes += tables.size_bytes[r * fragments + fragment];
  return bytes;
}

std::uint64_t sum_of(const std::vector<std::uint32_t>& bytes) {
  std::uint64_t sum = 0;
  for (const std::uint32_t b : bytes) sum += b;
  return sum;
}

}  // namespace texmesh
