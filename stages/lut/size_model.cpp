#include "stages/lut/size_model.h"

#include <cmath>

#include "format/base/portable_math.h"
#include "format/rules/allocation.h"
#include "format/rules/size_model.h"

namespace texmesh {
namespace {

/// y = offset + slope x.
struct Line {
  double slope = 0, offset = 0, correlation = 0;
};

Line least_squares(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  double mean_x = 0, mean_y = 0, xx = 0, xy = 0, yy = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    mean_x += x[k] / n;
    mean_y += y[k] / n;
  }
  for (std::size_t k = 0; k < x.size(); ++k) {
    xx += (x[k] - mean_x) * (x[k] - mean_x);
    xy += (x[k] - mean_x) * (y[k] - mean_y);
    yy += (y[k] - mean_y) * (y[k] - mean_y);
  }
  const double slope = xy / xx;
  return {slope, mean_y - slope * mean_x, yy > 0 ? xy / std::sqrt(xx * yy) : 0};
}

}  // namespace

std::vector<SizeModel> fit_size_models(const PlaneLadder& ladder, const PlaneTables& t,
                                       const std::vector<float>& vqp) {
  std::vector<SizeModel> models(t.fragment_count());
  std::vector<double> quality, log_size;
  for (std::size_t r = 0; r + (ladder.source_rung ? 1 : 0) < ladder.rungs.size(); ++r)
    quality.push_back(t.rung_quality[r] / 100.0);
  if (quality.size() < 2) return models;
  for (const std::uint16_t f : t.order) {
    const auto p = static_cast<double>(vqp[f]);
    if (!(p >= kLeastModelVqp)) continue;
    log_size.clear();
    for (std::size_t r = 0; r < quality.size(); ++r)
      log_size.push_back(portable::log(static_cast<double>(bytes_to_show(t, r, f))));
    const Line line = least_squares(quality, log_size);
    if (!(line.slope > 0)) continue;
    models[f].a = static_cast<float>(portable::exp(line.offset));
    models[f].b = static_cast<float>(line.slope / portable::log(100 * p));
    models[f].correlation = static_cast<float>(line.correlation);
  }
  return models;
}

}  // namespace texmesh
