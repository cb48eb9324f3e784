#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "format/base/sha256.h"

namespace texmesh {

/// Values of Gamma that tables hold sizes for: 0, 0.05 .. 1.
inline constexpr std::size_t kGammaSteps = 21;

/// Tables of one texture plane. F = columns * rows fragments (row by row from the top left), R rungs (rising
/// quality, rung 0 here is the lowest stored one; "skipped" has no entry), N = scales + 1 feature scales.
struct PlaneTables {
  std::uint32_t columns = 0, rows = 0;
  std::uint32_t scales = 0;  // N - 1
  bool incremental = false;  // a rung's streams continue those of the rungs below (CodecTraits::incremental)
  std::vector<std::uint8_t> rung_quality;  // [R], IJG quality, strictly rising
  std::vector<std::uint32_t> table_bytes;  // [R]: size of the rung's table stream
  // [R * F], index rung * F + fragment; 0 where the fragment is not stored:
  std::vector<std::uint32_t> size_bytes;  // of the abbreviated stream, exact
  std::vector<std::uint64_t> digest;      // first 8 bytes of the stream's SHA-256, as a big-endian number
  // over covered texels of luma (8-bit scale, 0..65025) | 1 - SSIM (0..2); stored as IEEE binary16:
  std::vector<float> mse, dssim;
  // [F]:
  std::vector<std::uint32_t> covered_texels;
  std::vector<float> surface_fraction;    // of the object's surface
  std::vector<float> z, i, zeta, m, vqp;  // 0..1, stored as multiples of 1 / 65535
  std::vector<std::uint16_t> order;       // stored fragments by falling importance (eta_0, surface, index)
  // [F], 1 - SSIM when the preview stands for the fragment, binary16; empty: format 1.0 did not say
  std::vector<float> skip_dssim;
  // Where sizes between two rungs are (format 1.1; empty: not measured): whole qualities that lie between
  // rungs, strictly rising, and the part of the way from the rung below to the one above that the bytes have
  // gone there, 0..1, not falling between two rungs, stored as multiples of 1 / 65535
  std::vector<std::uint8_t> knot_quality;
  std::vector<float> knot_position;
  // [N * F], index scale * F + fragment:
  std::vector<std::uint32_t> features;  // f_i < 2^24
  // [N]:
  std::vector<float> quality;  // Q_i
  // [N * 21]: D_i(Gamma), Gamma = 0, 0.05 .. 1: bytes of the plane at the rungs nearest to q_i(x, y)
  std::vector<std::uint64_t> total_bytes;
  // 0 thesis (3.2), 1 log-quantiser, 2 rate-distortion within the bytes of 1; with the widths and clip used:
  std::uint8_t allocation = 1;
  float quality_width = 60, log_width = 0.7f, quality_min = 5, quality_max = 97;
  // Size model S = A R^Q + c with exponent B from (8.8), fitted over the plane's rungs (thesis 8.6-8.8)
  float model_a = 0, model_b = 0, model_r = 0, model_correlation = 0;
  float model_error = 0;  // mean |S' - S| / S

  std::size_t fragment_count() const { return static_cast<std::size_t>(columns) * rows; }
  std::size_t rung_count() const { return rung_quality.size(); }
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.columns, s.rows, s.scales, s.incremental, s.rung_quality, s.table_bytes, s.size_bytes, s.digest,
      s.mse, s.dssim, s.covered_texels, s.surface_fraction, s.z, s.i, s.zeta, s.m, s.vqp, s.order,
      s.skip_dssim, s.knot_quality, s.knot_position, s.features, s.quality, s.total_bytes, s.allocation,
      s.quality_width, s.log_width, s.quality_min, s.quality_max, s.model_a, s.model_b, s.model_r,
      s.model_correlation, s.model_error);
  }
};

struct PackageTables {
  std::vector<PlaneTables> planes;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.planes);
  }
};

/// tables.bin, see SPEC.md. The reader checks magic, version, every count against the bytes, and every
/// value's range, and throws FormatError. write(read(x)) == x; values that the file stores in 16 bits are
/// rounded by the writer.
std::vector<std::uint8_t> write_tables(const PackageTables& tables);
PackageTables read_tables(std::span<const std::uint8_t> bytes);
/// The head alone tells where each plane's section stands, so that a client can read one plane by a range.
struct TablesSection {
  std::uint64_t offset = 0, bytes = 0;  // within tables.bin
  Sha256 digest{};
};
struct TablesHead {
  int minor = 0;
  std::uint64_t bytes = 0;  // of the head itself
  std::vector<TablesSection> planes;
};
TablesHead read_tables_head(std::span<const std::uint8_t> bytes);  // `bytes` may stop after the head
PlaneTables read_tables_section(const TablesHead& head, std::size_t plane,
                                std::span<const std::uint8_t> section);

}  // namespace texmesh
