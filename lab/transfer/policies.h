#pragma once

#include "delivery/cpp/decide/harmonic_time.h"

namespace texmesh {

// Every policy, order and estimator that the method was compared with, those of clients among them.

/// - kHtc: the method, around the plan of Eq. 3.2.
/// - kPrice: one price of bytes, in units of loss, that rises when the plan is late.
/// - kProportional: planned sizes scaled by the time left over the bytes left.
/// - kStatic: the planned sizes, whatever happens.
/// - kGuard, kThesis: GuardPolicy and ThesisPolicy, with the order that is asked for.
enum class LabPolicy : std::uint8_t { kHtc, kGuard, kPrice, kProportional, kStatic, kThesis };
/// Which end of the list is next. kCredit: by the sign of the next credit (negative: the finest fragment,
/// positive: the coarsest). kBeta0: by the last throughput against beta_0. kFinest: always the finest. kPrice
/// knows kFinest only.
enum class HtcOrder : std::uint8_t { kCredit, kBeta0, kFinest };
/// How the throughput of the next transfer is guessed from those that have ended. kLast: as clients do it.
/// kHarmonic: bytes over seconds of the last `samples`. kEwma: exponentially weighted mean.
enum class Estimator : std::uint8_t { kLast, kHarmonic, kEwma };

/// An exponentially weighted mean of throughput, bytes per second.
class EwmaThroughput {
 public:
  explicit EwmaThroughput(double initial_bytes_s = 1e5) : bytes_s_(initial_bytes_s) {}
  void add(double bytes, double seconds);  // as Throughput::add()
  double bytes_s() const { return bytes_s_; }
  static constexpr double kWeight = 0.2, kSmallBytes = 4000;  // smaller transfers weigh less

 private:
  double bytes_s_;
};

struct LabOptions {
  LabPolicy policy = LabPolicy::kHtc;
  HtcOrder order = HtcOrder::kCredit;
  Estimator estimator = Estimator::kLast;
  int samples = 10;  // of kHarmonic, 1 .. 64
};
/// The order, and the estimator, of a client that is told the policy alone.
HtcOrder default_order(LabPolicy policy);
Estimator default_estimator(LabPolicy policy);
/// The estimate after the samples that both were told.
double estimate_bytes_s(const LabOptions& options, const Throughput& all, const EwmaThroughput& ewma);
/// Lets this policy decide. The list is made as for kThesis where it is that, else as for kGuard.
void use_policy(const LabOptions& choice, HtcOptions& options);
/// The other options at their defaults.
HtcOptions options_of(const LabOptions& choice);
/// As in chapter 4: with limits of quality, one request at a time.
HtcOptions chapter_options(HtcOrder order);

}  // namespace texmesh
