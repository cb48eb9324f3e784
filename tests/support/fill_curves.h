#pragma once
// Bytes of a ladder over its error in covered texels: what the figures of fills are made of.
#include <cmath>
#include <cstdint>
#include <vector>

#include "format/documents/tables.h"

namespace texmesh::testing {

/// Bytes of fragment streams, and PSNR of luma over covered texels in dB.
struct FillPoint {
  double bytes = 0, psnr = 0;
};

/// Per rung, over the planes `shown`.
inline std::vector<FillPoint> fill_curve(const PackageTables& tables, const std::vector<std::size_t>& shown) {
  std::vector<FillPoint> out(tables.planes[shown[0]].rung_count());
  for (std::size_t r = 0; r < out.size(); ++r) {
    double error = 0, texels = 0;
    for (const std::size_t p : shown) {
      const PlaneTables& t = tables.planes[p];
      for (const std::uint16_t f : t.order) {
        const std::size_t at = r * t.fragment_count() + f;
        out[r].bytes += t.size_bytes[at];
        error += static_cast<double>(t.mse[at]) * t.covered_texels[f];
        texels += t.covered_texels[f];
      }
    }
    out[r].psnr = 10 * std::log10(65025 * texels / error);
  }
  return out;
}

/// Log-linear between the curve's points; 0 where it does not reach.
inline double bytes_at(const std::vector<FillPoint>& curve, double psnr) {
  for (std::size_t k = 1; k < curve.size(); ++k) {
    const FillPoint &a = curve[k - 1], &b = curve[k];
    if (psnr < a.psnr || psnr > b.psnr) continue;
    const double t = (psnr - a.psnr) / (b.psnr - a.psnr);
    return std::exp(std::log(a.bytes) + t * (std::log(b.bytes) - std::log(a.bytes)));
  }
  return 0;
}

}  // namespace texmesh::testing
