#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "format/documents/perceptual_table.h"

namespace texmesh {

/// Values of Gamma that tables hold sizes for: 0, 0.05 .. 1.
inline constexpr std::size_t kGammaSteps = 21;

/// S = A (100 p)^(B Q) of one fragment (thesis 8.5): bytes S at quality Q in 0..1, p its VQP. All 0 where
/// nothing was fitted.
struct SizeModel {
  float a = 0, b = 0;
  float correlation = 0;  // of Q and log S
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.a, s.b, s.correlation);
  }
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
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.z, s.i, s.zeta, s.m, s.vqp, s.models, s.quality, s.total_bytes);
  }
};

struct ThesisTables {
  std::vector<PlaneThesis> planes;
  PerceptualTable perceptual;
  bool empty() const { return planes.empty() && perceptual.empty(); }
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.planes, s.perceptual);
  }
};

/// thesis.bin (SPEC.md). Planes at the end without any section do not come back, what the file stores in 16
/// bits is rounded by the writer; else write(read(x)) == x. FormatError for counts, sizes and values that
/// break a rule; sections of unknown ids are skipped.
std::vector<std::uint8_t> write_thesis(const ThesisTables& tables);
struct ThesisFile {
  int minor = 0;
  ThesisTables tables;
};
ThesisFile read_thesis(std::span<const std::uint8_t> bytes);

}  // namespace texmesh
