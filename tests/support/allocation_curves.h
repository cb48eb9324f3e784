#pragma once
// Ways to share bytes among fragments, as curves of bytes over loss: what the allocation's figures are made
// of.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "format/documents/tables.h"
#include "format/rules/allocation.h"

namespace texmesh::testing {

/// Bytes of fragment streams, and surface-weighted 1 - SSIM.
struct Point {
  double bytes = 0, loss = 0;
};
using Curve = std::vector<Point>;  // by rising bytes

/// All base-colour planes of a package together.
struct Planes {
  std::vector<PlaneTables> tables;

  Point total(const std::vector<std::vector<std::int16_t>>& rungs) const {
    Point sum;
    double weight = 0;
    for (std::size_t p = 0; p < tables.size(); ++p) {
      double w = 0;
      for (const float v : surface_weights(tables[p])) w += static_cast<double>(v);
      sum.bytes += static_cast<double>(sum_of(bytes_of(tables[p], rungs[p])));
      sum.loss += w * surface_dssim(tables[p], rungs[p]);
      weight += w;
    }
    sum.loss /= weight;
    return sum;
  }
};

/// One rung for every stored fragment.
inline Point uniform(const Planes& planes, std::size_t rung) {
  std::vector<std::vector<std::int16_t>> rungs;
  for (const PlaneTables& t : planes.tables) {
    rungs.emplace_back(t.fragment_count(), kSkipped);
    for (const std::uint16_t f : t.order) rungs.back()[f] = static_cast<std::int16_t>(rung);
  }
  return planes.total(rungs);
}

/// Thesis or log at one scale, Q_i swept, Gamma = mean eta. A negative log_width: as the tables have it.
inline Curve swept(Planes planes, std::uint8_t allocation, std::size_t scale, double log_width) {
  Curve curve;
  for (double q = 1; q <= 100; q += 0.25) {
    std::vector<std::vector<std::int16_t>> rungs;
    for (PlaneTables& t : planes.tables) {
      t.allocation = allocation;
      if (log_width >= 0) t.log_width = static_cast<float>(log_width);
      t.quality[scale] = static_cast<float>(q);
      rungs.push_back(rungs_of(t, scale, mean_eta(t, scale)));
    }
    const Point p = planes.total(rungs);
    if (curve.empty() || p.bytes > curve.back().bytes) curve.push_back(p);
  }
  return curve;
}

/// Budgets of `least` to 1.2 times `most` bytes, spent over all planes at once.
inline Curve rate_distortion(const Planes& planes, double least, double most) {
  Curve curve;
  std::vector<RdCurve> all;
  std::vector<std::size_t> begin;
  double largest = 0;
  std::vector<double> peak;
  for (const PlaneTables& t : planes.tables) {
    peak.push_back(0);
    for (const float v : surface_weights(t)) peak.back() = std::max(peak.back(), static_cast<double>(v));
    largest = std::max(largest, peak.back());
  }
  for (std::size_t p = 0; p < planes.tables.size(); ++p) {
    begin.push_back(all.size());
    const auto curves = rd_curves(planes.tables[p], surface_weights(planes.tables[p]), peak[p] / largest);
    all.insert(all.end(), curves.begin(), curves.end());
  }
  for (double budget = least; budget <= most * 1.2; budget *= 1.01) {
    const auto ways = spend_bytes(all, static_cast<std::uint64_t>(budget));
    std::vector<std::vector<std::int16_t>> rungs;
    for (std::size_t p = 0; p < planes.tables.size(); ++p) {
      const PlaneTables& t = planes.tables[p];
      std::vector<std::uint16_t> stored = t.order;
      std::sort(stored.begin(), stored.end());
      rungs.emplace_back(t.fragment_count(), kSkipped);
      for (std::size_t k = 0; k < stored.size(); ++k)
        rungs.back()[stored[k]] = static_cast<std::int16_t>(static_cast<int>(ways[begin[p] + k]) - 1);
    }
    const Point point = planes.total(rungs);
    if (curve.empty() || point.bytes > curve.back().bytes) curve.push_back(point);
  }
  return curve;
}

/// Bytes of a curve at a loss: log-linear between its points; 0 where it does not reach.
inline double bytes_at(const Curve& curve, double loss) {
  for (std::size_t k = 1; k < curve.size(); ++k) {
    const Point &a = curve[k - 1], &b = curve[k];
    if (!(a.loss >= loss && b.loss <= loss)) continue;
    const double t = a.loss > b.loss ? (a.loss - loss) / (a.loss - b.loss) : 0;
    return std::exp(std::log(a.bytes) + t * (std::log(b.bytes) - std::log(a.bytes)));
  }
  return 0;
}

struct Ratios {
  double mean = 0, worst = 0;
};
/// What the figures are summed up from: not the lowest and the highest rung, beside which nothing can be.
inline Ratios over_uniform(const Curve& curve, const Curve& reference) {
  Ratios out;
  double sum = 0;
  int count = 0;
  for (const Point& p : reference) {
    const double bytes = bytes_at(curve, p.loss);
    if (bytes <= 0) continue;
    sum += std::log(bytes / p.bytes);
    out.worst = std::max(out.worst, bytes / p.bytes);
    ++count;
  }
  out.mean = count > 0 ? std::exp(sum / count) : 0;
  return out;
}

}  // namespace texmesh::testing
