#include "lab/transfer/policies.h"

#include <algorithm>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

constexpr double kPriceRise = 10;        // how fast the price rises with delay
constexpr double kLargestExponent = 12;  // of the price's factor: 1.6e5 either way
constexpr double kElasticity = 2.5;      // of the price by bytes, on ladders of photographs
constexpr double kSpareExponent = 1;
constexpr double kLateFactor = 1.2;  // what is asked for may take this much longer than is left

class HtcPolicy : public TransferPolicy {
 public:
  bool skips_early() const override { return true; }
};

class StaticPolicy : public TransferPolicy {
 public:
  double target_bytes(const HarmonicTimePlan& plan, std::uint32_t offer, double, double) const override {
    return plan.planned_bytes(offer);
  }
  bool skips_early() const override { return true; }
};

class ProportionalPolicy : public TransferPolicy {
 public:
  double target_bytes(const HarmonicTimePlan& plan, std::uint32_t offer, double,
                      double now_s) const override {
    return plan.planned_bytes(offer) * plan.proportional_share(now_s, plan.throughput_bytes_s());
  }
};

class PricePolicy : public TransferPolicy {
 public:
  void begin(const HarmonicTimePlan& plan, std::vector<double>&) override {
    priced_ = plan_by_price(plan);
    for (const double bytes : priced_.bytes) total_bytes_ += bytes;
  }
  bool begins_with_mean() const override { return false; }
  double target_bytes(const HarmonicTimePlan& plan, std::uint32_t offer, double, double) const override {
    return plan.planned_bytes(offer);
  }
  std::int32_t rung(const HarmonicTimePlan& plan, std::uint32_t offer, double, double now_s) const override {
    return plan.cheapest_rung(plan.offers()[offer], price_at(plan, now_s), plan.may_skip(now_s),
                              kLateFactor * plan.room_bytes(now_s));
  }

 private:
  double price_at(const HarmonicTimePlan& plan, double now_s) const {
    double done_bytes = 0;
    for (const HtcStep& s : plan.steps()) done_bytes += priced_.bytes[s.offer];
    const double limit_s = plan.options().time_limit_s;
    const double planned_s = total_bytes_ > 0 ? limit_s * (done_bytes / total_bytes_) : 0;
    // What is in flight has been issued but not paid for yet.
    const double lag = now_s - (planned_s - plan.in_flight_bytes() / plan.throughput_bytes_s());
    const double left_s = std::max(limit_s - now_s, 1e-3 * limit_s);
    // A lag alone asks for too much after a stall: no higher price than what is left can be sent at.
    const double room = plan.room_bytes(limit_s - left_s);
    const double ratio = (total_bytes_ - done_bytes) / std::max(room, 1.0);
    const double enough = kSpareExponent + kElasticity * portable::log(std::max(ratio, 1.0));
    return priced_.price * portable::exp(std::clamp(kPriceRise * lag / left_s, -kLargestExponent,
                                                    std::min(enough, kLargestExponent)));
  }
  PricedPlan priced_;
  double total_bytes_ = 0;
};

/// A policy with another order and another estimator.
template <class Base>
class Varied final : public Base {
 public:
  explicit Varied(const LabOptions& options) : options_(options) {}
  void begin(const HarmonicTimePlan& plan, std::vector<double>& planned) override {
    ewma_ = EwmaThroughput(plan.options().initial_bytes_s);
    Base::begin(plan, planned);
  }
  bool finest_is_next(const HarmonicTimePlan& plan, double credit_s) const override {
    if (!this->begins_with_mean() || options_.order == HtcOrder::kFinest) return true;
    if (options_.order == HtcOrder::kCredit) return credit_s <= 0;
    return plan.throughput_bytes_s() <= plan.options().initial_bytes_s;
  }
  double throughput_bytes_s(const HarmonicTimePlan& plan) const override {
    if (options_.estimator == Estimator::kLast) return Base::throughput_bytes_s(plan);
    return estimate_bytes_s(options_, plan.throughput(), ewma_);
  }
  void measured(double bytes, double seconds) override { ewma_.add(bytes, seconds); }

 private:
  LabOptions options_;
  EwmaThroughput ewma_;
};

std::unique_ptr<TransferPolicy> policy_of_lab(const LabOptions& o) {
  switch (o.policy) {
    case LabPolicy::kHtc:
      return std::make_unique<Varied<HtcPolicy>>(o);
    case LabPolicy::kGuard:
      return std::make_unique<Varied<GuardPolicy>>(o);
    case LabPolicy::kPrice:
      return std::make_unique<Varied<PricePolicy>>(o);
    case LabPolicy::kProportional:
      return std::make_unique<Varied<ProportionalPolicy>>(o);
    case LabPolicy::kStatic:
      return std::make_unique<Varied<StaticPolicy>>(o);
    case LabPolicy::kThesis:
      return std::make_unique<Varied<ThesisPolicy>>(o);
  }
  return nullptr;
}

}  // namespace

void EwmaThroughput::add(double bytes, double seconds) {
  const double weight = kWeight * std::min(1.0, bytes / kSmallBytes);
  bytes_s_ += weight * (bytes / std::max(seconds, Throughput::kLeastSeconds) - bytes_s_);
}

HtcOrder default_order(LabPolicy policy) {
  return policy == LabPolicy::kGuard    ? HtcOrder::kFinest
         : policy == LabPolicy::kThesis ? HtcOrder::kBeta0
                                        : HtcOrder::kCredit;
}

Estimator default_estimator(LabPolicy policy) {
  const bool harmonic =
      policy == LabPolicy::kPrice || policy == LabPolicy::kProportional || policy == LabPolicy::kStatic;
  return harmonic ? Estimator::kHarmonic : Estimator::kLast;
}

double estimate_bytes_s(const LabOptions& options, const Throughput& all, const EwmaThroughput& ewma) {
  if (options.estimator == Estimator::kEwma && !all.starting()) return ewma.bytes_s();
  return all.recent_bytes_s(
      options.estimator == Estimator::kHarmonic ? static_cast<std::size_t>(std::max(options.samples, 1)) : 1);
}

void use_policy(const LabOptions& choice, HtcOptions& options) {
  options.policy = choice.policy == LabPolicy::kThesis ? Policy::kThesis : Policy::kGuard;
  options.other_policy = [choice] { return policy_of_lab(choice); };
}

HtcOptions options_of(const LabOptions& choice) {
  HtcOptions options;
  use_policy(choice, options);
  return options;
}

HtcOptions chapter_options(HtcOrder order) {
  HtcOptions options = options_of({.order = order});
  options.hard_limits = true, options.window = 1;
  return options;
}

}  // namespace texmesh
