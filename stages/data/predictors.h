#pragma once
#include <vector>

namespace texmesh {

/// Per plane and fragment; 0 for fragments without coverage. z, i, zeta, m are raw (8.1-8.3), 0..1:
///   z = mean over the channels of the standard deviation / 127.5, i = mean / 255, m = 1 - (w_I (1 - i) +
///   w_zeta zeta), zeta = share of the pairs of neighbours, east and south, that differ (of 2 (w-1)(h-1)
///   pairs in a whole fragment).
/// Where a fragment is covered in part only its covered texels count, and pairs of them: what fills the rest
/// is never seen. Grey planes count as three equal channels. vqp (8.4) is the weighted mean of eta,
/// z, i and m, each min-max over the covered fragments of the plane (0 where all are equal).
struct PlanePredictors {
  std::vector<float> z, i, zeta, m, vqp;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.z, s.i, s.zeta, s.m, s.vqp);
  }
};

struct Predictors {
  std::vector<PlanePredictors> planes;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.planes);
  }
};

}  // namespace texmesh
