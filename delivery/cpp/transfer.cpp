#include "delivery/cpp/transfer.h"

#include <algorithm>
#include <map>

namespace texmesh {
namespace {

constexpr double kRetryFactor = 4, kLeastRetryRtts = 8, kLeastRetry_s = 0.5;
constexpr double kAskCancelled_s = 0.1;
constexpr double kForEver = 1e9;

/// Which mirror delivers first, by what each has delivered so far and has to deliver yet.
class Mirrors {
 public:
  Mirrors(std::size_t count, double initial_bytes_s) {
    ThroughputOptions options;
    options.initial_bytes_s = initial_bytes_s;
    for (std::size_t m = 0; m < count; ++m) mirrors_.push_back({Throughput(options), 0, 0, true});
  }
  /// `but`: the one that has just failed, unless it is the only one.
  std::uint32_t choose(double bytes, std::optional<std::uint32_t> but) const {
    std::size_t best = mirrors_.size();
    double best_s = 0;
    for (std::size_t m = 0; m < mirrors_.size(); ++m) {
      if (!mirrors_[m].alive || (but && *but == m && mirrors_.size() > 1)) continue;
      const double s = (mirrors_[m].owed_bytes + bytes) / mirrors_[m].throughput.bytes_s();
      if (best == mirrors_.size() || s < best_s) best = m, best_s = s;
    }
    return static_cast<std::uint32_t>(best == mirrors_.size() ? but.value_or(0) : best);
  }
  double asked(std::uint32_t m, double bytes) {
    mirrors_[m].owed_bytes += bytes;
    return mirrors_[m].owed_bytes / mirrors_[m].throughput.bytes_s();
  }
  void delivered(std::uint32_t m, double bytes, double from_s, double now_s) {
    Mirror& mirror = mirrors_[m];
    mirror.throughput.add(bytes, now_s - std::max(mirror.last_s, from_s));
    mirror.last_s = now_s;
    mirror.owed_bytes -= bytes;
  }
  /// It is left alone while another answers.
  void failed(std::uint32_t m, double bytes) {
    mirrors_[m].owed_bytes -= bytes;
    std::size_t alive = 0;
    for (const Mirror& mirror : mirrors_) alive += mirror.alive;
    if (alive > 1) mirrors_[m].alive = false;
  }

 private:
  struct Mirror {
    Throughput throughput;
    double owed_bytes = 0, last_s = 0;
    bool alive = true;
  };
  std::vector<Mirror> mirrors_;
};

struct Asked {
  TransferRequest request;
  std::uint32_t mirror = 0;
  double at_s = 0, patience_s = 0;
  int tries = 0;
};

class Run {
 public:
  Run(RequestSource& source, Transport& transport, const TransferOptions& options)
      : source_(source),
        transport_(transport),
        options_(options),
        mirrors_(transport.mirrors(), options.initial_bytes_s) {}

  TransferEnd run() {
    while (!source_.finished()) {
      if (over()) return stop();
      while (auto request = source_.next(transport_.now_s())) ask({std::move(*request), 0, 0, 0, 0}, {});
      if (source_.finished()) break;
      const double until = next_look_s();
      if (auto outcome = transport_.wait(until))
        take(*outcome);
      else if (asked_.empty() || transport_.now_s() >= kForEver)
        break;
      else
        ask_late_ones_elsewhere();
    }
    return end_;
  }

 private:
  bool over() const {
    return transport_.now_s() > options_.until_s || (options_.cancelled && options_.cancelled());
  }
  TransferEnd stop() {
    for (const auto& [number, a] : asked_) transport_.cancel(number);
    end_.cancelled = true;
    return end_;
  }

  void ask(Asked a, std::optional<std::uint32_t> but) {
    const auto bytes = static_cast<double>(a.request.bytes);
    a.mirror = mirrors_.choose(bytes, but);
    const double expected = mirrors_.asked(a.mirror, bytes);
    a.patience_s = std::max({kLeastRetry_s, kLeastRetryRtts * options_.rtt_s, kRetryFactor * expected});
    a.at_s = transport_.now_s();
    ++a.tries;
    transport_.start(a.request, a.mirror);
    asked_[a.request.number] = std::move(a);
  }

  double next_look_s() const {
    double until =
        options_.until_s < kForEver ? std::max(options_.until_s, transport_.now_s()) + 1e-3 : kForEver;
    if (transport_.mirrors() > 1)  // a single one can only be waited for
      for (const auto& [number, a] : asked_) until = std::min(until, a.at_s + a.patience_s);
    if (options_.cancelled) until = std::min(until, transport_.now_s() + kAskCancelled_s);
    return until;
  }

  void take(const Transport::Outcome& outcome) {
    const auto it = asked_.find(outcome.number);
    if (it == asked_.end()) return;
    Asked a = std::move(it->second);
    asked_.erase(it);
    const auto bytes = static_cast<double>(a.request.bytes);
    if (outcome.good && source_.arrived(outcome)) {
      mirrors_.delivered(a.mirror, bytes, a.at_s + options_.rtt_s, outcome.time_s);
      end_.last_s = outcome.time_s;
      return;
    }
    mirrors_.failed(a.mirror, bytes);
    if (a.tries >= options_.tries) {
      source_.failed(a.request.number, outcome.time_s);
      return;
    }
    const std::uint32_t failed_by = a.mirror;
    ask(std::move(a), failed_by);
  }

  void ask_late_ones_elsewhere() {
    if (transport_.mirrors() < 2) return;
    std::vector<Asked> late;
    for (const auto& [number, a] : asked_)
      if (a.at_s + a.patience_s <= transport_.now_s()) late.push_back(a);
    for (Asked& a : late) {
      transport_.cancel(a.request.number);
      mirrors_.failed(a.mirror, static_cast<double>(a.request.bytes));
      asked_.erase(a.request.number);
      const std::uint32_t silent = a.mirror;
      ask(std::move(a), silent);
    }
  }

  RequestSource& source_;
  Transport& transport_;
  TransferOptions options_;
  Mirrors mirrors_;
  std::map<std::uint32_t, Asked> asked_;
  TransferEnd end_;
};

}  // namespace

TransferEnd transfer(RequestSource& source, Transport& transport, const TransferOptions& options) {
  return Run(source, transport, options).run();
}

PlanSource::PlanSource(HarmonicTimePlan& plan, double start_s, Parts parts, Take take)
    : plan_(plan),
      start_s_(start_s),
      parts_(std::move(parts)),
      take_(std::move(take)),
      rung_(plan.offers().size(), -1) {}

std::optional<TransferRequest> PlanSource::next(double now_s) {
  const HtcStep* step = plan_.next(now_s - start_s_);
  if (!step) return std::nullopt;
  rung_[step->offer] = step->rung;
  return TransferRequest{step->offer, step->bytes,
                         parts_ ? parts_(step->offer, step->rung) : std::vector<PackagePart>{}};
}

bool PlanSource::arrived(const Transport::Outcome& outcome) {
  if (take_ && !take_(outcome.number, rung_[outcome.number], outcome)) return false;
  plan_.completed(outcome.number, outcome.time_s - start_s_);
  return true;
}

}  // namespace texmesh
