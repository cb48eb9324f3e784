#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

namespace texmesh {

// Harmonic Time Compensation (thesis ch. 4 and Appendix A, as corrected): a list of fragments is transferred
// so that the last one arrives at the time limit T_0, though throughput moves. Each fragment has a share
// theta_g of the time. A transfer that takes dT less or more than its time hands dT on: it is spread over the
// next fragments with weights 1/2, 1/3, ..., the nearest most. The size that fits a fragment's time decides
// the fragment's rung.
//
// The plan does no I/O and reads no clock: the caller gives the time. The arithmetic is plain doubles and
// format/base/portable_math.h, so C++ and TypeScript decide the same, bit for bit (delivery/vectors).

/// One fragment as the plan sees it.
struct FragmentOffer {
  std::vector<std::uint32_t> bytes;  // by rung, lowest first; at least one, all > 0
  std::vector<double> loss;  // [rungs + 1]: what is lost when it is skipped, then by rung; any unit, >= 0
  double eta = 0;            // feature density times weights; orders the list
  double planned_bytes = 0;  // d_g > 0: what it gets by Eq. 3.2
  std::uint16_t low_rung = 0, high_rung = 0xffff;  // limits of quality, see HtcOptions::hard_limits
};

/// What may be fetched after the deadline: upgrades of fragments in order of loss saved per byte, each from
/// the rung before. `rungs` by offer, -1 = skipped. With `incremental` rungs (each continues the one below)
/// only the missing bytes count.
struct Upgrade {
  std::uint32_t offer = 0;
  std::int32_t rung = 0;
  std::uint64_t bytes = 0;
  double gain_per_byte = 0;
};
std::vector<Upgrade> upgrades_in_order(const std::vector<FragmentOffer>& offers,
                                       const std::vector<std::int32_t>& rungs, bool incremental = false);

/// Other transfers that are under way when one ends.
struct OtherTransfers {
  std::size_t count = 0;
  double bytes = 0;  // of all of them, whatever has arrived already
};

/// Throughput of a connection or a group of them. Plain double arithmetic: the same bits everywhere.
class Throughput {
 public:
  static constexpr double kLeastSeconds = 1e-9;
  explicit Throughput(double initial_bytes_s);  // beta_0 > 0, the estimate until there is a sample
  /// `seconds`: since the end of the transfer before, latency taken off; less than kLeastSeconds counts as
  /// that. The link's first seconds serve all transfers under way, and what has arrived of `others` is not
  /// known. So, until more transfers have ended than are under way, the estimate is beta_0, as far as it lies
  /// between what the link has given if nothing of the others has arrived, and if all of it has.
  void add(double bytes, double seconds, const OtherTransfers& others = {});
  /// Bytes over seconds of at most so many samples: a harmonic mean in which large transfers count more,
  /// since small ones mostly measure latency.
  double recent_bytes_s(std::size_t samples) const;
  bool starting() const { return starting_; }  // no more transfers have ended than are under way
  /// The mean of the last `seconds` > 0 of transfers; what lies before the first counts as beta_0.
  double mean_bytes_s(double seconds) const;

 private:
  struct Sample {
    double bytes = 0, seconds = 0;
  };
  double initial_bytes_s_;
  std::vector<Sample> ring_;  // the newest at (count_ - 1) % size
  std::vector<Sample> sums_;  // of all samples up to each
  std::size_t count_ = 0;
  bool starting_ = true;
  double start_bytes_s_ = 0;  // the estimate while starting_
};

class HarmonicTimePlan;

/// A policy: which fragment is next, and how large it may be. The plan keeps the list, the time and what was
/// measured, and asks its policy; one object serves one plan. These functions are the method itself, as
/// corrected: the sign of the next credit says which end of the list is next, and the target is what the
/// fragment's time carries. Derived policies replace some of them.
class TransferPolicy {
 public:
  virtual ~TransferPolicy() = default;
  /// Before the first request: may change the planned sizes d_g, bytes by offer, all > 0.
  virtual void begin(const HarmonicTimePlan&, std::vector<double>&) {}
  /// Whether etas count from Gamma: F-bar is the offer whose eta is nearest to 0, not to the mean.
  virtual bool counts_from_gamma() const { return false; }
  /// Whether F-bar comes first.
  virtual bool begins_with_mean() const { return true; }
  /// Whether the finest fragment is next; else the coarsest.
  virtual bool finest_is_next(const HarmonicTimePlan&, double credit_s) const { return credit_s <= 0; }
  /// The throughput that decisions suppose, bytes per second.
  virtual double throughput_bytes_s(const HarmonicTimePlan& plan) const;
  /// A transfer has ended: what Throughput::add() is told.
  virtual void measured(double /*bytes*/, double /*seconds*/) {}
  /// Bytes of the list that T_0 is divided over.
  virtual double list_bytes(const HarmonicTimePlan& plan) const;
  virtual double target_bytes(const HarmonicTimePlan& plan, std::uint32_t offer, double theta_s,
                              double now_s) const;
  /// Whether fragments may be skipped though their lowest rungs would come in time.
  virtual bool skips_early() const { return false; }
  /// -1: the fragment is skipped.
  virtual std::int32_t rung(const HarmonicTimePlan& plan, std::uint32_t offer, double target_bytes,
                            double now_s) const;
};

/// The method around the plan of least loss. A size stays within a factor of 1.5 of the plan's share of the
/// bytes that the link gives in the time left, so that noisy links make sizes swing less. What shows most
/// comes first.
class GuardPolicy : public TransferPolicy {
 public:
  void begin(const HarmonicTimePlan& plan, std::vector<double>& planned) override;
  bool finest_is_next(const HarmonicTimePlan&, double) const override { return true; }
  double target_bytes(const HarmonicTimePlan& plan, std::uint32_t offer, double theta_s,
                      double now_s) const override;
};

/// The method with (4.1) and (4.2) as printed: theta_g = T_0 d_g / D_1, D_1 = T_0 beta_0, and the last
/// throughput against beta_0 says which end is next. Offers are those of ListOptions::thesis.
class ThesisPolicy : public TransferPolicy {
 public:
  bool counts_from_gamma() const override { return true; }
  bool finest_is_next(const HarmonicTimePlan& plan, double) const override;
  double list_bytes(const HarmonicTimePlan& plan) const override;
};

/// The policies of clients. They differ in the list, too: plan_delivery() makes it by this.
enum class Policy : std::uint8_t { kGuard, kThesis };

struct HtcOptions {
  Policy policy = Policy::kGuard;
  /// Where it is set, it makes the policy that decides instead; `policy` then says what the list is made for.
  std::function<std::unique_ptr<TransferPolicy>()> other_policy;
  double time_limit_s = 5;       // T_0, of the fragments alone: mesh and preview have their own time before
  double initial_bytes_s = 1e5;  // beta_0, > 0
  double rtt_s = 0;              // round trip, measured or told
  int window = 0;  // requests in flight; 0 = until 1.5 x throughput x round trip, 2 a site to 64
  int sites = 1;   // servers that the fragments are spread over, 1 .. 64
  // true: no rung below low_rung and no fragment skipped, as in the thesis. false: the same while there is
  // time enough, then rungs down to the lowest, then skipping. A rung that loses as much as skipping is never
  // chosen.
  bool hard_limits = false;
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

  bool finished() const { return all_issued() && in_flight_ == 0; }
  const std::vector<FragmentOffer>& offers() const { return offers_; }
  const std::vector<HtcStep>& steps() const { return steps_; }
  double throughput_bytes_s() const { return policy_->throughput_bytes_s(*this); }
  /// Pi: T_0 less the time taken. Once finished(), Pi equals the residuals for which no fragment was left.
  double surplus_s() const { return options_.time_limit_s - last_done_s_; }
  double unspent_s() const { return unspent_s_; }
  /// Chosen rung by offer; -1 skipped or not decided.
  std::vector<std::int32_t> rungs() const;

  // What policies ask of their plan.

  const HtcOptions& options() const { return options_; }
  const Throughput& throughput() const { return throughput_; }
  double planned_bytes(std::uint32_t offer) const { return planned_[offer]; }  // d_g
  double planned_total() const { return planned_total_; }
  std::uint32_t lowest_bytes(const FragmentOffer& f) const { return f.bytes[lowest(f, false)]; }
  double in_flight_bytes() const { return in_flight_bytes_; }
  /// Bytes that can still arrive in time besides those in flight.
  double room_bytes(double throughput_bytes_s, double now_s) const;
  /// The same at the throughput of the last ten transfers.
  double room_bytes(double now_s) const;
  /// What a plan in proportion to the planned sizes gives, as a factor of them.
  double proportional_share(double now_s, double throughput_bytes_s) const;
  bool may_skip(double now_s) const;
  /// The rung (-1: skipping) with the least loss + price x bytes of those with at most so many bytes; ties:
  /// the lowest.
  std::int32_t cheapest_rung(const FragmentOffer& offer, double price, bool may_skip,
                             double most_bytes) const;
  /// The rung whose size is nearest, within the limits of quality while these can hold.
  std::int32_t nearest_rung(const FragmentOffer& offer, double target_bytes, double now_s) const;

 private:
  struct Credit {
    double value = 0;        // dT / zeta
    std::size_t issued = 0;  // positions that were issued when the credit arose
  };
  bool all_issued() const { return steps_.size() == offers_.size(); }
  bool window_open(double now_s) const;
  double credit_at(std::size_t position) const;
  std::uint32_t choose_offer(double credit) const;
  void remove_from_list(std::uint32_t offer);
  std::size_t lowest(const FragmentOffer& offer, bool limits) const;
  HtcStep& issued(std::uint32_t offer);
  void finish(HtcStep& step, double now_s, bool sample);
  void spread(double residual_s);

  std::vector<FragmentOffer> offers_;
  HtcOptions options_;
  std::unique_ptr<TransferPolicy> policy_;
  Throughput throughput_;
  std::vector<double> harmonic_;  // H_0 .. H_{n+1}
  std::vector<Credit> credits_;
  std::vector<HtcStep> steps_;
  std::vector<std::uint32_t> sorted_;  // offers by falling eta
  std::vector<std::size_t> step_of_offer_;
  std::vector<bool> taken_;
  std::uint32_t left_ = 0, right_ = 0, mean_ = 0;  // remaining: [left_, right_) less what is taken
  std::vector<double> planned_;                    // d_g in bytes by offer, as the policy has them
  double planned_total_ = 0, planned_left_ = 0;    // bytes
  double smallest_left_ = 0;                       // bytes of the offers not issued, at their lowest rungs
  double low_left_ = 0;                            // the same at their low_rung
  std::uint32_t in_flight_ = 0;
  std::vector<std::size_t> waiting_;  // steps in flight
  int skips_in_a_row_ = 0;
  double in_flight_bytes_ = 0;
  double latency_s_ = 0;  // at the start, in which nothing can arrive
  double last_done_s_ = 0, unspent_s_ = 0;
};

/// One price of bytes, in units of loss, at which the list takes T_0 x beta_0.
struct PricedPlan {
  double price = 0;
  std::vector<double> bytes;  // by offer, 0 = skipped
};
PricedPlan plan_by_price(const HarmonicTimePlan& plan);

}  // namespace texmesh
