#include "delivery/cpp/transfer/transfer.h"

#include <algorithm>
#include <map>
#include <utility>

namespace texmesh {
namespace {

constexpr double kRetryFactor = 4, kLeastRetryRtts = 8, kLeastRetry_s = 0.5;
constexpr double kProgressBytes = 1024;  // a try that brings as much does not count
constexpr double kAskCancelled_s = 0.1;
constexpr double kFirstPause_s = 0.1, kMostPause_s = 5;

/// Which mirror delivers first, by what each has delivered so far and has to deliver yet.
class Mirrors {
 public:
  Mirrors(std::size_t count, double initial_bytes_s) {
    ThroughputOptions options;
    options.initial_bytes_s = initial_bytes_s;
    for (std::size_t m = 0; m < count; ++m) mirrors_.push_back({Throughput(options)});
  }
  /// Nothing when all of them have failed for good. `but`: the one that has just failed, unless it is
  /// the only one.
  std::optional<std::uint32_t> choose(double bytes, std::optional<std::uint32_t> but, double now_s) const {
    std::optional<std::uint32_t> best = best_of(bytes, but, now_s);
    if (!best && but) best = best_of(bytes, {}, now_s);
    return best;
  }
  /// When it may be asked.
  double ready_s(std::uint32_t m) const { return mirrors_[m].ready_s; }
  double asked(std::uint32_t m, double bytes) {
    mirrors_[m].owed_bytes += bytes;
    return mirrors_[m].owed_bytes / mirrors_[m].throughput.bytes_s();
  }
  void delivered(std::uint32_t m, double bytes, double from_s, double now_s) {
    Mirror& mirror = mirrors_[m];
    mirror.throughput.add(bytes, now_s - std::max(mirror.last_s, from_s));
    mirror.last_s = now_s;
    mirror.owed_bytes -= bytes;
    mirror.failures = 0;
    mirror.has_delivered = true;
  }
  /// It is left alone while another answers.
  void failed(std::uint32_t m, double bytes, bool for_good) {
    mirrors_[m].owed_bytes -= bytes;
    mirrors_[m].alive = false;
    mirrors_[m].gone |= for_good;
    if (std::ranges::none_of(mirrors_, &Mirror::alive))
      for (Mirror& mirror : mirrors_) mirror.alive = !mirror.gone;
  }
  /// It is asked again no sooner than after a pause: its own, or one that grows from failure to failure.
  void pause(std::uint32_t m, double now_s, double wait_s) {
    Mirror& mirror = mirrors_[m];
    const double growing_s = kFirstPause_s * static_cast<double>(1 << std::min(mirror.failures++, 6));
    mirror.ready_s = std::max(mirror.ready_s, now_s + std::min(kMostPause_s, std::max(wait_s, growing_s)));
  }
  /// Another one that has shown that it delivers.
  bool another_delivers(std::uint32_t but) const {
    for (std::size_t m = 0; m < mirrors_.size(); ++m)
      if (m != but && mirrors_[m].alive && mirrors_[m].has_delivered) return true;
    return false;
  }

 private:
  struct Mirror {
    Throughput throughput;
    double owed_bytes = 0, last_s = 0, ready_s = 0;
    int failures = 0;
    bool alive = true, gone = false, has_delivered = false;
  };
  std::optional<std::uint32_t> best_of(double bytes, std::optional<std::uint32_t> but, double now_s) const {
    std::optional<std::uint32_t> best;
    double best_s = 0;
    for (std::size_t m = 0; m < mirrors_.size(); ++m) {
      const Mirror& mirror = mirrors_[m];
      if (!mirror.alive || (but && *but == m)) continue;
      const double s =
          (mirror.owed_bytes + bytes) / mirror.throughput.bytes_s() + std::max(0.0, mirror.ready_s - now_s);
      if (!best || s < best_s) best = static_cast<std::uint32_t>(m), best_s = s;
    }
    return best;
  }
  std::vector<Mirror> mirrors_;
};

struct Asked {
  TransferRequest request;
  std::uint32_t mirror = 0;
  double at_s = 0, patience_s = 0;
  int tries = 0;
  double received = 0;  // when last looked at
  double kept = 0;      // by the transport, of tries that broke
};

class TransferRun {
 public:
  TransferRun(RequestSource& source, Transport& transport, const TransferOptions& options)
      : source_(source),
        transport_(transport),
        options_(options),
        mirrors_(transport.mirrors(), options.initial_bytes_s) {}

  TransferEnd run() {
    while (!source_.finished()) {
      if (over()) return stop();
      start_waiting();
      while (auto request = source_.next(transport_.now_s())) ask({std::move(*request)}, {});
      if (source_.finished()) break;
      const double until = next_look_s();
      if (auto outcome = transport_.wait(until))
        end_try(*outcome);
      else if (asked_.empty() && waiting_.empty())
        break;
      else if (until >= kForEver_s)
        give_up_all();
      else
        ask_late_ones_elsewhere();
    }
    return end_;
  }

 private:
  bool over() {
    end_.cancelled = options_.cancelled && options_.cancelled();
    end_.out_of_time = transport_.now_s() > options_.until_s;
    return end_.cancelled || end_.out_of_time;
  }
  TransferEnd stop() {
    for (const auto& [number, a] : asked_) transport_.cancel(number);
    end_.unfinished = static_cast<std::uint32_t>(asked_.size() + waiting_.size());
    for (const auto& [number, a] : asked_) source_.failed(number, transport_.now_s());
    for (const Asked& a : waiting_) source_.failed(a.request.number, transport_.now_s());
    return end_;
  }
  /// No server will ever answer.
  void give_up_all() {
    end_.dead = true;
    const auto dead = std::exchange(asked_, {});
    for (const auto& [number, a] : dead) {
      transport_.cancel(number);
      mirrors_.failed(a.mirror, static_cast<double>(a.request.bytes), false);
      give_up(a, "no answer");
    }
  }
  void give_up(const Asked& a, const std::string& why) {
    ++end_.problems[why];
    ++end_.given_up;
    source_.failed(a.request.number, transport_.now_s());
  }

  /// Asks a mirror, or notes that one is to be asked when its pause is over.
  void ask(Asked a, std::optional<std::uint32_t> but) {
    const double now_s = transport_.now_s();
    const auto bytes = static_cast<double>(a.request.bytes);
    const auto mirror = mirrors_.choose(bytes, but, now_s);
    if (!mirror) {
      give_up(a, "no server is left");
      return;
    }
    a.mirror = *mirror;
    a.at_s = mirrors_.ready_s(a.mirror);
    if (a.at_s > now_s) {
      waiting_.push_back(std::move(a));
      return;
    }
    const double expected = mirrors_.asked(a.mirror, bytes);
    a.patience_s = std::max({kLeastRetry_s, kLeastRetryRtts * options_.rtt_s, kRetryFactor * expected});
    a.at_s = now_s;
    a.received = 0;
    ++a.tries;
    transport_.start(a.request, a.mirror);
    asked_[a.request.number] = std::move(a);
  }
  void start_waiting() {
    const double now_s = transport_.now_s();
    std::vector<Asked> due;
    std::erase_if(waiting_, [&](Asked& a) {
      if (a.at_s > now_s) return false;
      due.push_back(std::move(a));
      return true;
    });
    for (Asked& a : due) ask(std::move(a), {});
  }

  double next_look_s() const {
    double until =
        options_.until_s < kForEver_s ? std::max(options_.until_s, transport_.now_s()) + 1e-3 : kForEver_s;
    if (transport_.mirrors() > 1)  // a single one can only be waited for
      for (const auto& [number, a] : asked_) until = std::min(until, a.at_s + a.patience_s);
    for (const Asked& a : waiting_) until = std::min(until, a.at_s);
    if (options_.cancelled) until = std::min(until, transport_.now_s() + kAskCancelled_s);
    return until;
  }

  void end_try(const Transport::Outcome& outcome) {
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
    const std::string why = outcome.good ? "bytes of another digest" : outcome.problem;
    if (outcome.wait_s > 0) mirrors_.pause(a.mirror, outcome.time_s, outcome.wait_s);
    retry_or_give_up(std::move(a), why, outcome.for_good);
  }
  void retry_or_give_up(Asked a, const std::string& why, bool for_good) {
    mirrors_.failed(a.mirror, static_cast<double>(a.request.bytes), for_good);
    if (const double kept = transport_.received(a.request.number); kept >= a.kept + kProgressBytes) {
      a.kept = kept;
      a.tries = 0;
    }
    if (a.tries >= options_.tries) {
      give_up(a, why);
      return;
    }
    ++end_.problems[why];
    const std::uint32_t failed_by = a.mirror;
    ask(std::move(a), failed_by);
  }

  void ask_late_ones_elsewhere() {
    if (transport_.mirrors() < 2) return;
    std::vector<Asked> late;
    for (auto& [number, a] : asked_) {
      if (a.at_s + a.patience_s > transport_.now_s()) continue;
      // Slow, but nobody is known to be faster.
      const double received = transport_.received(number);
      if (received > a.received && !mirrors_.another_delivers(a.mirror)) {
        a.received = received;
        a.at_s = transport_.now_s();
        continue;
      }
      late.push_back(a);
    }
    for (Asked& a : late) {
      transport_.cancel(a.request.number);
      asked_.erase(a.request.number);
      retry_or_give_up(std::move(a), "no answer in time", false);
    }
  }

  RequestSource& source_;
  Transport& transport_;
  TransferOptions options_;
  Mirrors mirrors_;
  std::map<std::uint32_t, Asked> asked_;
  std::vector<Asked> waiting_;  // for the end of their mirror's pause, at_s
  TransferEnd end_;
};

}  // namespace

TransferEnd transfer(RequestSource& source, Transport& transport, const TransferOptions& options) {
  return TransferRun(source, transport, options).run();
}

PlanSource::PlanSource(HarmonicTimePlan& plan, double start_s, Parts parts, Accept accept)
    : plan_(plan),
      start_s_(start_s),
      parts_(std::move(parts)),
      accept_(std::move(accept)),
      rung_(plan.offers().size(), -1) {}

std::optional<TransferRequest> PlanSource::next(double now_s) {
  const HtcStep* step = plan_.next(now_s - start_s_);
  if (!step) return std::nullopt;
  rung_[step->offer] = step->rung;
  return TransferRequest{step->offer, step->bytes,
                         parts_ ? parts_(step->offer, step->rung) : std::vector<PackagePart>{}};
}

bool PlanSource::arrived(const Transport::Outcome& outcome) {
  if (accept_ && !accept_(outcome.number, rung_[outcome.number], outcome)) return false;
  plan_.completed(outcome.number, outcome.time_s - start_s_);
  return true;
}

}  // namespace texmesh
