#pragma once

#include "format/base/bytes.h"
#include "format/base/fields.h"

namespace texmesh {

/// What says how much two scales differ. kP95: the relative distance between their surfaces. The others are
/// the thesis's strategies (7.2) over the collapses between them: average, conservative = the largest change,
/// aggressive = the smallest one.
enum class PerceptualStatistic : std::uint8_t { kP95, kAverage, kConservative, kAggressive };
template <>
struct EnumNames<PerceptualStatistic> {
  static constexpr std::array<std::string_view, 4> names{"p95", "average", "conservative", "aggressive"};
};

/// Most scales of a chain, S_0 among them.
inline constexpr std::size_t kMostChainScales = 100;

/// Perceptual values of the whole chain of scales, stored or not (thesis 7.2, Tables 7.1 and 7.2). C scales,
/// S_0 first; a row is a place in `scale`. Pairs are those of rows i < j, by i, then j.
struct PerceptualTable {
  std::vector<std::uint8_t> scale;                        // [C]: scale numbers, rising from 0
  std::vector<std::uint32_t> triangles;                   // [C]
  std::vector<std::uint32_t> collapses;                   // [C]: from the row before to this one; 0 for S_0
  std::vector<float> average, largest, least, deviation;  // [C]: of rho over those collapses; 0 for S_0
  std::vector<float> p95;                                 // [pairs]: of S_i's distances to S_j over R_eff
  // [pairs]: of rho over all collapses from S_i to S_j, each against the vertex that is left in S_j.
  std::vector<float> chain_average, chain_largest, chain_least;
  bool empty() const { return scale.empty(); }
  static void archive(auto& s, auto& a) {
    a(s.scale, s.triangles, s.collapses, s.average, s.largest, s.least, s.deviation, s.p95, s.chain_average,
      s.chain_largest, s.chain_least);
  }
  friend bool operator==(const PerceptualTable&, const PerceptualTable&) = default;
};

/// Number of pairs of so many rows.
constexpr std::size_t pair_count(std::size_t rows) { return rows < 2 ? 0 : rows * (rows - 1) / 2; }
/// Place of rows i < j < `rows` in the arrays of pairs.
constexpr std::size_t pair_index(std::size_t rows, std::size_t i, std::size_t j) {
  return i * (2 * rows - i - 1) / 2 + (j - i - 1);
}

/// Section 4 of thesis.bin. FormatError of rule O05 where values break the rule.
Bytes write_perceptual_section(const PerceptualTable& table);
/// The reader's bytes are the section's; what stands behind the table is left to the caller.
PerceptualTable read_perceptual_section(BytesIn& in, bool reserved_is_zero);

/// Values of Gamma that tables hold sizes for: 0, 0.05 .. 1.
inline constexpr std::size_t kGammaSteps = 21;

/// S = A (100 p)^(B Q) of one fragment (thesis 8.5): bytes S at quality Q in 0..1, p its VQP. All 0 where
/// nothing was fitted.
struct SizeModel {
  float a = 0, b = 0;
  float correlation = 0;  // of Q and log S
  static void archive(auto& s, auto& a) { a(s.a, s.b, s.correlation); }
  friend bool operator==(const SizeModel&, const SizeModel&) = default;
};

/// What only the thesis's policy and reports read of a texture plane. F fragments; M scales of the chain, by
/// scale number, also those that no package stores. An empty array says nothing.
struct PlaneThesis {
  // [F], 0..1, stored as multiples of 1 / 65535; 0 for fragments that are not stored
  std::vector<float> z, i, zeta, m, vqp;
  std::vector<SizeModel> models;  // [F]
  std::vector<float> quality;     // [M]: Q_i
  // [M * 21]: D_i(Gamma), Gamma = 0, 0.05 .. 1: bytes of the plane at the rungs nearest to q_i(x, y)
  std::vector<std::uint64_t> total_bytes;
  static void archive(auto& s, auto& a) {
    a(s.z, s.i, s.zeta, s.m, s.vqp, s.models, s.quality, s.total_bytes);
  }
};

struct ThesisTables {
  std::vector<PlaneThesis> planes;
  PerceptualTable perceptual;
  bool empty() const { return planes.empty() && perceptual.empty(); }
  static void archive(auto& s, auto& a) { a(s.planes, s.perceptual); }
};

/// thesis.bin of a package of that minor version (SPEC.md). Planes at the end without any section do not come
/// back, what the file stores in 16 bits is rounded by the writer; else write(read(x)) == x. FormatError for
/// counts, sizes and values that break a rule; sections of unknown ids are skipped.
std::vector<std::uint8_t> write_thesis(const ThesisTables& tables, int minor = 0);
struct ThesisFile {
  int minor = 0;
  ThesisTables tables;
};
ThesisFile read_thesis(std::span<const std::uint8_t> bytes);

}  // namespace texmesh
