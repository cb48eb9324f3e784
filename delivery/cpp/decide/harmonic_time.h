#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "delivery/cpp/decide/fragment_offer.h"
#include "delivery/cpp/decide/throughput.h"

namespace texmesh {

// Harmonic Time Compensation (thesis ch. 4 and Appendix A, as corrected): a list of fragments is transferred
// so that the last one arrives at the time limit T_0, though throughput moves. Each fragment has a share
// theta_g of the time. A transfer that takes dT less or more than its time hands dT on: it is spread over the
// next fragments with weights 1/2, 1/3, ..., the nearest most. The size that fits a fragment's time decides
// the fragment's rung.
//
// The plan does no I/O and reads no clock: the caller gives the time. The arithmetic is plain doubles and
// format/base/portable_math.h, so C++ and TypeScript decide the same, bit for bit (delivery/vectors).

/// How rungs are chosen.
/// - kHtc: the method, around the plan of Eq. 3.2.
/// - kGuard: the method around the plan of least loss. A size stays within a factor of the plan's share of
///   the bytes that the link gives in the time left, so that noisy links make sizes swing less.
/// - kPrice: one price of bytes, in units of loss, that rises when the plan is late.
/// - kProportional: planned sizes scaled by the time left over the bytes left.
/// - kStatic: the planned sizes, whatever happens.
/// - kThesis: kHtc with (4.1) and (4.2) as printed, theta_g = T_0 d_g / D_1, D_1 = T_0 beta_0. Offers are
///   those of thesis_list(), whose etas count from Gamma: F-bar is the offer whose eta is nearest to 0.
enum class Policy : std::uint8_t { kHtc, kGuard, kPrice, kProportional, kStatic, kThesis };
/// Which end of the list is next. kCredit: by the sign of the next credit (negative: the finest fragment,
/// positive: the coarsest). kBeta0: by the last throughput against beta_0. kFinest: always the finest.
enum class HtcOrder : std::uint8_t { kCredit, kBeta0, kFinest };
/// The order of a client that is told the policy alone. With kGuard what shows most comes first.
constexpr HtcOrder default_order(Policy policy) {
  return policy == Policy::kGuard ? HtcOrder::kFinest : HtcOrder::kCredit;
}

struct HtcOptions {
  Policy policy = Policy::kHtc;
  HtcOrder order = HtcOrder::kCredit;
  double time_limit_s = 5;  // T_0, of the fragments alone: mesh and preview have their own time before
  ThroughputOptions throughput{Estimator::kLast, 10, 0.2, 4000, 1e5};  // initial_bytes_s is beta_0
  double rtt_s = 0;                                                    // round trip, measured or told
  int window = 0;  // requests in flight; 0 = until 1.5 x throughput x round trip, at least 2 a site
  int sites = 1;   // servers that the fragments are spread over, 1 .. 64
  int max_in_flight = 64;
  // true: no rung below low_rung and no fragment skipped, as in the thesis. false: the same while there is
  // time enough, then rungs down to the lowest, then skipping. A rung that loses as much as skipping is never
  // chosen.
  bool hard_limits = false;
  double guard = 1.5;       // factor of kGuard, > 1
  double price_kappa = 10;  // how fast kPrice's price rises with delay
};

/// A decision and what became of it.
struct HtcStep {
  std::uint32_t position = 0;  // k = 1 .. n in the order of decisions
  std::uint32_t offer = 0;     // index into the list
  std::int32_t rung = -1;      // -1 = skipped
  std::uint32_t bytes = 0;
  double credit_s = 0, theta_s = 0;  // credit_k and theta_k = theta_g + credit_k
  double target_bytes = 0;           // d_k asked for
  double throughput_bytes_s = 0;     // beta_{k-1}, which the decision supposes
  double issued_s = 0;
  double done_s = -1;     // -1: in flight
  double spacing_s = 0;   // gamma_k: since the completion before (since the start for the first)
  double residual_s = 0;  // dT_k = theta_k - gamma_k
};

class HarmonicTimePlan {
 public:
  /// The list is taken by falling eta (ties: index), whatever order the offers have. Throws
  /// std::invalid_argument for values out of range.
  HarmonicTimePlan(std::vector<FragmentOffer> offers, const HtcOptions& options);

  /// The next request, while the window has room. Fragments that are skipped are decided on the way and stand
  /// in steps(). nullptr: nothing more to issue now (wait for a completion) or at all. The pointer holds
  /// until the next call. `now_s` >= 0 counts from the first request.
  const HtcStep* next(double now_s);
  /// The request for this offer has ended. Completions may come in any order; times must not fall.
  void completed(std::uint32_t offer, double now_s);
  /// The request failed and was given up: the time is spent, and the fragment counts as skipped.
  void failed(std::uint32_t offer, double now_s);

  bool all_issued() const { return steps_.size() == offers_.size(); }
  bool finished() const { return all_issued() && in_flight_ == 0; }
  const std::vector<FragmentOffer>& offers() const { return offers_; }
  const std::vector<HtcStep>& steps() const { return steps_; }
  double throughput_bytes_s() const;
  /// Pi: T_0 less the time taken. Once finished(), Pi equals the residuals for which no fragment was left.
  double surplus_s() const { return options_.time_limit_s - last_done_s_; }
  double unspent_s() const { return unspent_s_; }
  /// Chosen rung by offer; -1 skipped or not decided.
  std::vector<std::int32_t> rungs() const;
  /// A limit under 30 round trips cannot be met well (p95 beyond 2.5 %).
  bool too_short_for_rtt() const { return options_.time_limit_s < 30 * options_.rtt_s; }

 private:
  struct Credit {
    double value = 0;        // dT / zeta
    std::size_t issued = 0;  // positions that were issued when the credit arose
  };
  void plan_prices();
  void plan_for_least_loss();
  bool window_open(double now_s) const;
  double credit_at(std::size_t position) const;
  std::uint32_t choose_offer(double credit) const;
  void remove_from_list(std::uint32_t offer);
  double theta_of(std::uint32_t offer) const;
  double target_of(std::uint32_t offer, double theta_s, double now_s) const;
  double room_bytes(double beta, double now_s) const;
  double proportional_share(double now_s, double beta) const;
  double lasting_bytes_s(double now_s) const;
  bool limits_can_hold(double now_s) const;
  std::size_t lowest(const FragmentOffer& offer, bool limits) const;
  std::int32_t rung_of(std::uint32_t offer, double target, double now_s) const;
  std::int32_t cheapest_rung_of(const FragmentOffer& offer, double price, bool may_skip,
                                double most_bytes) const;
  double price_at(double now_s) const;
  double most_exponent(double left_s) const;
  bool may_skip(double now_s) const;
  void finish(HtcStep& step, double now_s, bool sample);
  void spread(double residual_s);

  std::vector<FragmentOffer> offers_;
  HtcOptions options_;
  Throughput throughput_;
  std::vector<double> harmonic_;  // H_0 .. H_{n+1}
  std::vector<Credit> credits_;
  std::vector<HtcStep> steps_;
  std::vector<std::uint32_t> sorted_;  // offers by falling eta
  std::vector<std::size_t> step_of_offer_;
  std::vector<bool> taken_;
  std::uint32_t left_ = 0, right_ = 0, mean_ = 0;  // remaining: [left_, right_) less what is taken
  std::vector<double> planned_;                    // d_g in bytes by offer, by the policy's plan
  double planned_total_ = 0, planned_left_ = 0;    // bytes
  double smallest_left_ = 0;                       // bytes of the offers not issued, at their lowest rungs
  double low_left_ = 0;                            // the same at their low_rung
  // kPrice: lambda_0; bytes of the policy's plan, and how many of these were issued
  double price_0_ = 0, price_total_ = 0, price_done_ = 0;
  std::vector<double> price_bytes_;
  std::uint32_t in_flight_ = 0;
  std::vector<std::size_t> waiting_;  // steps in flight
  int skips_in_a_row_ = 0;
  double in_flight_bytes_ = 0;
  double latency_s_ = 0;  // at the start, in which nothing can arrive
  double last_done_s_ = 0, unspent_s_ = 0;
};

}  // namespace texmesh
