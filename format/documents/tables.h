#pragma once
#include <vector>

#include "format/base/sha256.h"

namespace texmesh {

/// PlaneTables::allocation where VQP takes the place of eta.
inline constexpr std::uint8_t kByVqp = 3;

/// Tables of one texture plane. F = columns * rows fragments (row by row from the top left), R rungs (rising
/// quality, rung 0 here is the lowest stored one; "skipped" has no entry), N feature scales: in a package
/// those that its manifest has, in its order; from stage `lut` all of the chain, by scale number.
struct PlaneTables {
  std::uint32_t columns = 0, rows = 0;
  bool incremental = false;  // a rung's streams continue those of the rungs below (CodecTraits::incremental)
  std::vector<std::uint8_t> rung_quality;  // [R], IJG quality, strictly rising
  std::vector<std::uint32_t> table_bytes;  // [R]: size of the rung's table stream
  // Stored fragments by falling importance (eta_0, surface, index). A fragment is stored at every rung or at
  // none; in a package exactly those with covered texels are. All below is 0 for the others.
  std::vector<std::uint16_t> order;
  // [R * F], index rung * F + fragment:
  std::vector<std::uint32_t> size_bytes;  // of the abbreviated stream, exact
  std::vector<std::uint64_t> digest;      // first 8 bytes of the stream's SHA-256, as a big-endian number
  // over covered texels of luma (8-bit scale, 0..65025) | 1 - SSIM (0..2); stored as IEEE binary16:
  std::vector<float> mse, dssim;
  // [F]:
  std::vector<float> skip_dssim;  // 1 - SSIM when the preview stands for the fragment, binary16
  std::vector<std::uint32_t> covered_texels;
  std::vector<float> surface_fraction;  // of the object's surface
  // Where sizes between two rungs are (empty: not measured): whole qualities that lie between rungs, strictly
  // rising, and the part of the way from the rung below to the one above that the bytes have gone there,
  // 0..1, not falling between two rungs, stored as multiples of 1 / 65535
  std::vector<std::uint8_t> knot_quality;
  std::vector<float> knot_position;
  // [N * F], index row * F + fragment:
  std::vector<std::uint32_t> features;  // f_i < 2^24
  // [N]:
  std::vector<float> quality;  // Q_i
  // 0 thesis (3.2), 1 log-quantiser, 2 rate-distortion within the bytes of 1, 3 thesis with VQP in eta's
  // place (8.3); with the widths and clip used:
  std::uint8_t allocation = 1;
  float quality_width = 60, log_width = 0.7f, quality_min = 5, quality_max = 97;
  // [F], 0..1, stored as multiples of 1 / 65535: p of (8.4) at S_0 where the allocation is 3, else empty
  std::vector<float> vqp;
  float density_weight = 0;  // 0..1: what part of p is eta; above 0 with allocation 3 alone, from 2.1 on

  std::size_t fragment_count() const { return static_cast<std::size_t>(columns) * rows; }
  std::size_t rung_count() const { return rung_quality.size(); }
  std::size_t scale_count() const { return quality.size(); }  // N
  static void archive(auto& s, auto& a) {
    a(s.columns, s.rows, s.incremental, s.rung_quality, s.table_bytes, s.order, s.size_bytes, s.digest, s.mse,
      s.dssim, s.skip_dssim, s.covered_texels, s.surface_fraction, s.knot_quality, s.knot_position,
      s.features, s.quality, s.allocation, s.quality_width, s.log_width, s.quality_min, s.quality_max, s.vqp,
      s.density_weight);
  }
};

struct PackageTables {
  std::vector<PlaneTables> planes;
  static void archive(auto& s, auto& a) { a(s.planes); }
};

/// The tables with the rows of these scales only, in this order; `rows` are indices of rows that are there.
PackageTables select_scales(const PackageTables& tables, const std::vector<std::size_t>& rows);

/// The least minor version that packages with these tables can have: 2.1 has density_weight.
int needed_minor(const PackageTables& tables);

/// tables.bin of a package of that minor version, needed_minor() or later, see SPEC.md. The reader checks
/// magic, version, every count against the bytes, and every value's range, and throws FormatError.
/// write(read(x)) == x; values that the file stores in 16 bits are rounded by the writer, and values of
/// fragments that are not stored left out.
std::vector<std::uint8_t> write_tables(const PackageTables& tables, int minor = 0);
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
