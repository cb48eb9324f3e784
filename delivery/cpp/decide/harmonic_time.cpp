#include "delivery/cpp/decide/harmonic_time.h"

#include <algorithm>
#include <cmath>
#include <queue>
#include <stdexcept>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

constexpr std::size_t kRing = 64;  // samples of throughput that are kept

/// The upgrade that saves most loss per byte, from this rung on; gain 0 when none saves any.
Upgrade best_upgrade(const FragmentOffer& f, std::uint32_t offer, std::int32_t rung, bool incremental) {
  Upgrade best{offer, rung, 0, 0};
  std::uint64_t bytes = 0;
  for (std::size_t r = static_cast<std::size_t>(rung + 1); r < f.bytes.size(); ++r) {
    bytes = incremental ? bytes + f.bytes[r] : f.bytes[r];
    const double gain =
        (f.loss[static_cast<std::size_t>(rung + 1)] - f.loss[r + 1]) / static_cast<double>(bytes);
    if (gain > best.gain_per_byte) best = {offer, static_cast<std::int32_t>(r), bytes, gain};
  }
  return best;
}

constexpr double kWindowFactor = 1.5;  // of throughput x round trip
constexpr std::uint32_t kMostInFlight = 64;
constexpr std::size_t kTripSamples = 64;  // a window that follows every swing makes them worse
constexpr std::size_t kWindowSamples = 10, kGuardSamples = 20;
constexpr double kBreak = 4;    // a link this many times faster or slower is another link
constexpr double kGuard = 1.5;  // factor of GuardPolicy
// A stall that is over looks like a slow link until something has been transferred: what is skipped on such
// evidence is lost for good.
constexpr int kMostSkipsInARow = 1;

void require(bool good, const char* what) {
  if (!good) throw std::invalid_argument(what);
}

void check(const std::vector<FragmentOffer>& offers, const HtcOptions& o) {
  require(offers.size() < 1u << 24, "HarmonicTimePlan: fewer than 2^24 fragments");
  require(o.time_limit_s > 0 && o.time_limit_s <= 1e6, "HarmonicTimePlan: time limit in (0, 1e6] s");
  require(o.initial_bytes_s > 0, "HarmonicTimePlan: initial throughput > 0");
  require(o.rtt_s >= 0 && o.rtt_s < 1e4, "HarmonicTimePlan: round trip in [0, 1e4) s");
  require(o.window >= 0, "HarmonicTimePlan: window");
  require(o.sites >= 1 && o.sites <= 64, "HarmonicTimePlan: sites");
  for (const FragmentOffer& f : offers) {
    require(!f.bytes.empty() && f.loss.size() == f.bytes.size() + 1,
            "FragmentOffer: a loss per rung and one more");
    require(f.planned_bytes > 0 && f.planned_bytes < 1e12, "FragmentOffer: planned bytes > 0");
    for (const std::uint32_t b : f.bytes) require(b > 0, "FragmentOffer: bytes > 0");
    for (const double l : f.loss) require(l >= 0 && l < 1e300, "FragmentOffer: loss >= 0");
    require(std::isfinite(f.eta), "FragmentOffer: eta");
  }
}

std::vector<double> harmonic_numbers(std::size_t n) {
  std::vector<double> h(n + 2, 0.0);
  for (std::size_t i = 1; i < h.size(); ++i) h[i] = h[i - 1] + 1.0 / static_cast<double>(i);
  return h;
}

/// F-bar: the fragment with eta nearest the mean, or nearest Gamma where etas count from Gamma (ties: the
/// first).
std::uint32_t mean_fragment(const std::vector<FragmentOffer>& offers, bool from_gamma) {
  double sum = 0;
  for (const FragmentOffer& f : offers) sum += f.eta;
  const double mean = from_gamma ? 0 : sum / static_cast<double>(std::max<std::size_t>(offers.size(), 1));
  std::uint32_t best = 0;
  for (std::uint32_t i = 1; i < offers.size(); ++i)
    if (std::abs(offers[i].eta - mean) < std::abs(offers[best].eta - mean)) best = i;
  return best;
}

std::size_t highest(const FragmentOffer& f) { return std::min<std::size_t>(f.high_rung, f.bytes.size() - 1); }

/// 0 where it is skipped.
std::uint32_t bytes_at_rung(const FragmentOffer& f, std::int32_t rung) {
  return rung < 0 ? 0 : f.bytes[static_cast<std::size_t>(rung)];
}

/// The rung from `low` on that costs least (ties: the first), of those that have so few bytes; -1: skipping
/// does. `cost` of bytes and what is then lost.
template <typename Cost>
std::int32_t least_rung(const FragmentOffer& f, std::size_t low, bool may_skip, double most_bytes,
                        const Cost& cost) {
  std::int32_t best = may_skip ? -1 : static_cast<std::int32_t>(low);
  double least = may_skip ? cost(0.0, f.loss[0]) : cost(f.bytes[low], f.loss[low + 1]);
  for (std::size_t r = low; r <= highest(f); ++r) {
    if (f.bytes[r] > most_bytes) continue;
    const double now = cost(f.bytes[r], f.loss[r + 1]);
    if (now >= least) continue;
    least = now;
    best = static_cast<std::int32_t>(r);
  }
  return best;
}

/// What the link will give in the time left: its mean over as long a time until now, so that bursts shorter
/// than that do not count; but a link that stalls, falls or comes back by more than kBreak does not return
/// to its mean.
double lasting_bytes_s(const HarmonicTimePlan& plan, double now_s) {
  const double recent = plan.throughput().recent_bytes_s(kGuardSamples);
  const double left_s = plan.options().time_limit_s - now_s;
  if (left_s <= 0) return recent;
  const double mean = plan.throughput().mean_bytes_s(left_s);
  return recent * kBreak > mean && recent < kBreak * mean ? mean : recent;
}

std::unique_ptr<TransferPolicy> policy_of(const HtcOptions& o) {
  if (o.other_policy) return o.other_policy();
  if (o.policy == Policy::kThesis) return std::make_unique<ThesisPolicy>();
  return std::make_unique<GuardPolicy>();
}

}  // namespace

std::vector<Upgrade> upgrades_in_order(const std::vector<FragmentOffer>& offers,
                                       const std::vector<std::int32_t>& rungs, bool incremental) {
  const auto later = [](const Upgrade& a, const Upgrade& b) {
    return a.gain_per_byte != b.gain_per_byte ? a.gain_per_byte < b.gain_per_byte : a.offer > b.offer;
  };
  std::priority_queue<Upgrade, std::vector<Upgrade>, decltype(later)> heap(later);
  const auto push = [&](std::uint32_t offer, std::int32_t rung) {
    const Upgrade u = best_upgrade(offers[offer], offer, rung, incremental);
    if (u.gain_per_byte > 0) heap.push(u);
  };
  for (std::uint32_t i = 0; i < offers.size(); ++i) push(i, rungs[i]);
  std::vector<Upgrade> order;
  while (!heap.empty()) {
    order.push_back(heap.top());
    heap.pop();
    push(order.back().offer, order.back().rung);
  }
  return order;
}

Throughput::Throughput(double initial_bytes_s)
    : initial_bytes_s_(initial_bytes_s), ring_(kRing), start_bytes_s_(initial_bytes_s) {}

void Throughput::add(double bytes, double seconds, const OtherTransfers& others) {
  const Sample sample{bytes, std::max(seconds, kLeastSeconds)};
  ring_[count_++ % kRing] = sample;
  const Sample before = sums_.empty() ? Sample{} : sums_.back();
  sums_.push_back({before.bytes + sample.bytes, before.seconds + sample.seconds});
  starting_ = starting_ && count_ <= others.count;
  const Sample all = sums_.back();
  start_bytes_s_ =
      std::clamp(initial_bytes_s_, all.bytes / all.seconds, (all.bytes + others.bytes) / all.seconds);
}

double Throughput::recent_bytes_s(std::size_t samples) const {
  const std::size_t n = std::min({samples, count_, kRing});
  if (n == 0 || starting_) return start_bytes_s_;
  double bytes = 0, seconds = 0;
  for (std::size_t i = 1; i <= n; ++i) {
    const Sample& s = ring_[(count_ - i) % kRing];
    bytes += s.bytes;
    seconds += s.seconds;
  }
  return bytes / seconds;
}

double Throughput::mean_bytes_s(double seconds) const {
  const Sample all = sums_.empty() ? Sample{} : sums_.back();
  const double from = all.seconds - seconds;
  if (from <= 0) return (all.bytes - from * initial_bytes_s_) / seconds;
  const auto cut = std::upper_bound(sums_.begin(), sums_.end() - 1, from,
                                    [](double s, const Sample& sum) { return s < sum.seconds; });
  const Sample before = cut == sums_.begin() ? Sample{} : cut[-1];
  const double part = (cut->seconds - from) / (cut->seconds - before.seconds);
  return (all.bytes - cut->bytes + part * (cut->bytes - before.bytes)) / seconds;
}

HarmonicTimePlan::HarmonicTimePlan(std::vector<FragmentOffer> offers, const HtcOptions& options)
    : offers_(std::move(offers)),
      options_(options),
      policy_(policy_of(options)),
      throughput_(options.initial_bytes_s) {
  check(offers_, options_);
  const std::size_t n = offers_.size();
  std::vector<std::size_t> order(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return offers_[a].eta > offers_[b].eta; });
  harmonic_ = harmonic_numbers(n);
  sorted_.assign(order.begin(), order.end());
  steps_.reserve(n);
  step_of_offer_.assign(n, n);
  taken_.assign(n, false);
  right_ = static_cast<std::uint32_t>(n);
  mean_ = mean_fragment(offers_, policy_->counts_from_gamma());
  planned_.reserve(n);
  for (const FragmentOffer& f : offers_) {
    planned_.push_back(f.planned_bytes);
    smallest_left_ += f.bytes[lowest(f, false)];
    low_left_ += f.bytes[lowest(f, true)];
  }
  // Nothing can arrive in the first round trip. Counted as a delay it would starve the fragments that come
  // next; with one request at a time every fragment has a round trip of its own.
  if (options_.window != 1) latency_s_ = std::min(options_.rtt_s, options_.time_limit_s / 2);
  policy_->begin(*this, planned_);
  for (const double bytes : planned_) planned_total_ += bytes;
  planned_left_ = planned_total_;
}

bool HarmonicTimePlan::window_open(double now_s) const {
  if (options_.window > 0) return in_flight_ < static_cast<std::uint32_t>(options_.window);
  const std::uint32_t least = 2 * static_cast<std::uint32_t>(options_.sites);
  if (in_flight_ < least) return true;
  if (in_flight_ >= kMostInFlight) return false;
  // What is in flight takes all the time that is left: what is asked for now could only be late.
  const double left_s = options_.time_limit_s - now_s;
  if (left_s > latency_s_ && room_bytes(now_s) <= 0) return false;
  // Counted in fragments of the planned size: counted in bytes, many small ones would be in flight when there
  // is little time, and those are received side by side and late.
  const double fragment_bytes = planned_total_ / static_cast<double>(offers_.size());
  const double trip_bytes = throughput_.recent_bytes_s(kTripSamples) * options_.rtt_s;
  return in_flight_ < least + kWindowFactor * trip_bytes / fragment_bytes;
}

const HtcStep* HarmonicTimePlan::next(double now_s) {
  while (!all_issued() && window_open(now_s)) {
    const std::size_t position = steps_.size() + 1;
    const double credit = credit_at(position);
    const std::uint32_t offer = choose_offer(credit);
    const FragmentOffer& f = offers_[offer];
    HtcStep step;
    step.position = static_cast<std::uint32_t>(position);
    step.offer = offer;
    step.credit_s = credit;
    step.theta_s =
        (options_.time_limit_s - latency_s_) * (planned_[offer] / policy_->list_bytes(*this)) + credit;
    step.throughput_bytes_s = throughput_bytes_s();
    step.target_bytes = policy_->target_bytes(*this, offer, step.theta_s, now_s);
    step.rung = policy_->rung(*this, offer, step.target_bytes, now_s);
    step.bytes = bytes_at_rung(f, step.rung);
    step.issued_s = now_s;
    remove_from_list(offer);
    step_of_offer_[offer] = steps_.size();
    steps_.push_back(step);
    if (step.rung < 0) {  // no transfer: it takes no time and says nothing of the link
      HtcStep& skipped = steps_.back();
      skipped.done_s = now_s;
      skipped.residual_s = skipped.theta_s;
      ++skips_in_a_row_;
      spread(skipped.residual_s);
      continue;
    }
    skips_in_a_row_ = 0;
    waiting_.push_back(steps_.size() - 1);
    ++in_flight_;
    in_flight_bytes_ += step.bytes;
    return &steps_.back();
  }
  return nullptr;
}

std::uint32_t HarmonicTimePlan::choose_offer(double credit) const {
  if (steps_.empty() && policy_->begins_with_mean()) return mean_;
  const bool finest = policy_->finest_is_next(*this, credit);
  std::uint32_t left = left_, right = right_;
  while (left < right && taken_[sorted_[left]]) ++left;
  while (left < right && taken_[sorted_[right - 1]]) --right;
  return sorted_[finest ? left : right - 1];
}

void HarmonicTimePlan::remove_from_list(std::uint32_t offer) {
  const FragmentOffer& f = offers_[offer];
  taken_[offer] = true;
  while (left_ < right_ && taken_[sorted_[left_]]) ++left_;
  while (left_ < right_ && taken_[sorted_[right_ - 1]]) --right_;
  planned_left_ -= planned_[offer];
  smallest_left_ -= f.bytes[lowest(f, false)];
  low_left_ -= f.bytes[lowest(f, true)];
}

// credit_i: the share 1 / (chi zeta), chi = 2 for the position after the last issued one, of every dT so far.
double HarmonicTimePlan::credit_at(std::size_t position) const {
  double credit = 0;
  for (const Credit& c : credits_) credit += c.value / static_cast<double>(position - c.issued + 1);
  return credit;
}

void HarmonicTimePlan::spread(double residual_s) {
  const std::size_t issued = steps_.size(), left = offers_.size() - issued;
  if (left == 0) {
    unspent_s_ += residual_s;
    return;
  }
  const double zeta = harmonic_[left + 1] - 1.0;  // 1/2 + ... + 1/(left + 1)
  credits_.push_back({residual_s / zeta, issued});
}

/// What is asked for now arrives a round trip later, whether or not enough is in flight until then.
double HarmonicTimePlan::room_bytes(double beta, double now_s) const {
  const double left_s = options_.time_limit_s - now_s;
  return std::max(0.0, std::min(beta * left_s - in_flight_bytes_, beta * (left_s - latency_s_)));
}

double HarmonicTimePlan::room_bytes(double now_s) const {
  return room_bytes(throughput_.recent_bytes_s(kWindowSamples), now_s);
}

double HarmonicTimePlan::proportional_share(double now_s, double beta) const {
  return room_bytes(beta, now_s) / std::max(planned_left_, 1.0);
}

bool HarmonicTimePlan::may_skip(double now_s) const {
  if (options_.hard_limits) return false;
  if (options_.time_limit_s - now_s <= latency_s_) return true;  // it could not arrive in time
  if (skips_in_a_row_ >= kMostSkipsInARow) return false;
  return policy_->skips_early() || smallest_left_ > room_bytes(now_s);
}

/// The lowest rung worth asking for: unless limits are hard, one that shows more than the preview does.
std::size_t HarmonicTimePlan::lowest(const FragmentOffer& f, bool limits) const {
  const bool hard = options_.hard_limits;
  const std::size_t low = limits || hard ? std::min<std::size_t>(f.low_rung, f.bytes.size() - 1) : 0;
  for (std::size_t r = low; r <= highest(f) && !hard; ++r)
    if (f.loss[r + 1] < f.loss[0]) return r;
  return low;
}

std::int32_t HarmonicTimePlan::cheapest_rung(const FragmentOffer& f, double price, bool may_skip,
                                             double most_bytes) const {
  return least_rung(f, lowest(f, false), may_skip, most_bytes,
                    [&](double bytes, double loss) { return loss + price * bytes; });
}

std::int32_t HarmonicTimePlan::nearest_rung(const FragmentOffer& f, double target, double now_s) const {
  const bool skip = may_skip(now_s);
  const bool limits = options_.hard_limits || low_left_ <= room_bytes(now_s);
  return least_rung(f, lowest(f, limits), skip && !limits, 1e300,
                    [&](double bytes, double) { return std::abs(target - bytes); });
}

HtcStep& HarmonicTimePlan::issued(std::uint32_t offer) {
  require(offer < offers_.size() && step_of_offer_[offer] < steps_.size(), "HarmonicTimePlan: not issued");
  return steps_[step_of_offer_[offer]];
}

void HarmonicTimePlan::completed(std::uint32_t offer, double now_s) { finish(issued(offer), now_s, true); }

void HarmonicTimePlan::failed(std::uint32_t offer, double now_s) {
  finish(issued(offer), now_s, false);
  issued(offer).rung = -1;
}

void HarmonicTimePlan::finish(HtcStep& step, double now_s, bool sample) {
  require(step.done_s < 0 && now_s >= last_done_s_, "HarmonicTimePlan: completed twice, or time runs back");
  step.done_s = now_s;
  step.spacing_s = std::max(0.0, now_s - std::max(last_done_s_, latency_s_));
  step.residual_s = step.theta_s - step.spacing_s;
  // The link was idle only while nothing that was asked for could have been on its way.
  double first_issued_s = step.issued_s;
  for (const std::size_t i : waiting_) first_issued_s = std::min(first_issued_s, steps_[i].issued_s);
  std::erase(waiting_, step_of_offer_[step.offer]);
  --in_flight_;
  in_flight_bytes_ -= step.bytes;
  if (sample) {
    const double seconds = now_s - std::max(last_done_s_, first_issued_s + options_.rtt_s);
    throughput_.add(step.bytes, seconds, {in_flight_, in_flight_bytes_});
    policy_->measured(step.bytes, seconds);
  }
  last_done_s_ = now_s;
  spread(step.residual_s);
}

std::vector<std::int32_t> HarmonicTimePlan::rungs() const {
  std::vector<std::int32_t> rungs(offers_.size(), -1);
  for (const HtcStep& s : steps_) rungs[s.offer] = s.rung;
  return rungs;
}

double TransferPolicy::throughput_bytes_s(const HarmonicTimePlan& plan) const {
  // With several requests in flight completions come in bunches: only sums over some of them say anything.
  return plan.throughput().recent_bytes_s(plan.options().window != 1 ? kWindowSamples : 1);
}

double TransferPolicy::list_bytes(const HarmonicTimePlan& plan) const { return plan.planned_total(); }

double TransferPolicy::target_bytes(const HarmonicTimePlan& plan, std::uint32_t offer, double theta_s,
                                    double) const {
  if (plan.steps().empty()) return plan.planned_bytes(offer);  // F-bar has the quality Q_i
  // Alone in flight it has to wait for a round trip first.
  const double wait = plan.options().window == 1 ? plan.options().rtt_s : 0;
  return plan.throughput_bytes_s() * (theta_s - wait);
}

std::int32_t TransferPolicy::rung(const HarmonicTimePlan& plan, std::uint32_t offer, double target_bytes,
                                  double now_s) const {
  return plan.nearest_rung(plan.offers()[offer], target_bytes, now_s);
}

// Bisection on the price's logarithm.
PricedPlan plan_by_price(const HarmonicTimePlan& plan) {
  const double budget = plan.options().time_limit_s * plan.options().initial_bytes_s;
  const auto bytes_at = [&](const FragmentOffer& f, double price) -> double {
    return bytes_at_rung(f, plan.cheapest_rung(f, price, true, budget));
  };
  double low = -60, high = 60;  // of ln(price)
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2, price = portable::exp(middle);
    double sum = 0;
    for (const FragmentOffer& f : plan.offers()) sum += bytes_at(f, price);
    (sum > budget ? low : high) = middle;
  }
  PricedPlan out{portable::exp(high), {}};
  for (const FragmentOffer& f : plan.offers()) out.bytes.push_back(bytes_at(f, out.price));
  return out;
}

void GuardPolicy::begin(const HarmonicTimePlan& plan, std::vector<double>& planned) {
  planned = plan_by_price(plan).bytes;
  for (std::uint32_t i = 0; i < planned.size(); ++i)
    planned[i] = std::max<double>(planned[i], plan.lowest_bytes(plan.offers()[i]));
}

double GuardPolicy::target_bytes(const HarmonicTimePlan& plan, std::uint32_t offer, double theta_s,
                                 double now_s) const {
  if (plan.steps().empty()) return plan.planned_bytes(offer);
  const double target = TransferPolicy::target_bytes(plan, offer, theta_s, now_s);
  const double even =
      plan.planned_bytes(offer) * plan.proportional_share(now_s, lasting_bytes_s(plan, now_s));
  return std::clamp(target, even / kGuard, even * kGuard);
}

bool ThesisPolicy::finest_is_next(const HarmonicTimePlan& plan, double) const {
  return plan.throughput_bytes_s() <= plan.options().initial_bytes_s;
}

double ThesisPolicy::list_bytes(const HarmonicTimePlan& plan) const {
  return plan.options().time_limit_s * plan.options().initial_bytes_s;  // D_1
}

}  // namespace texmesh
