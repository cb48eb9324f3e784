#include "delivery/cpp/transfer/transfer.h"

namespace texmesh {
namespace {

constexpr std::size_t kSamples = 10;  // that say what a mirror delivers
constexpr double kRetryFactor = 4, kLeastRetryRtts = 8, kLeastRetry_s = 0.5;
constexpr double kProgressBytes = 1024;  // a try that brings as much does not count
constexpr double kAskCancelled_s = 0.1;
constexpr double kFirstPause_s = 0.1, kMostPause_s = 5;
constexpr const char* kLie = "bytes of another digest";

/// Which mirror delivers first, by what each has delivered so far and has to deliver yet.
class Mirrors {
 public:
  Mirrors(std::size_t count, double initial_bytes_s) {
    for (std::size_t m = 0; m < count; ++m) mirrors_.push_back({Throughput(initial_bytes_s)});
  }
  using Lacks = std::function<bool(std::uint32_t mirror)>;
  /// Nothing when all that have it have failed for good. `but`: the one that has just failed, unless it is
  /// the only one.
  std::optional<std::uint32_t> choose(double bytes, std::optional<std::uint32_t> but, double now_s,
                                      const Lacks& lacks) const {
    std::optional<std::uint32_t> best = best_of(bytes, but, now_s, lacks);
    if (!best && but) best = best_of(bytes, {}, now_s, lacks);
    return best;
  }
  /// When it may be asked.
  double ready_s(std::uint32_t m) const { return mirrors_[m].ready_s; }
  double asked(std::uint32_t m, double bytes) {
    mirrors_[m].owed_bytes += bytes;
    return mirrors_[m].owed_bytes / mirrors_[m].throughput.recent_bytes_s(kSamples);
  }
  void delivered(std::uint32_t m, double bytes, double from_s, double now_s) {
    Mirror& mirror = mirrors_[m];
    mirror.throughput.add(bytes, now_s - std::max(mirror.last_s, from_s));
    mirror.last_s = now_s;
    mirror.owed_bytes -= bytes;
    mirror.failures = 0;
    mirror.has_delivered = true;
    ++mirror.share.requests;
    mirror.share.bytes += static_cast<std::uint64_t>(bytes);
  }
  /// The request is no longer its.
  void released(std::uint32_t m, double bytes) { mirrors_[m].owed_bytes -= bytes; }
  /// It delivers, but not in the time that was expected.
  void slow(std::uint32_t m, double bytes, double seconds) { mirrors_[m].throughput.add(bytes, seconds); }
  /// It is left alone while another answers.
  void failed(std::uint32_t m) {
    mirrors_[m].alive = false;
    revive();
  }
  /// It is asked no more; a liar only where there is no other.
  void drop(std::uint32_t m, const std::string& why, bool lied) {
    mirrors_[m].alive = false;
    (lied ? mirrors_[m].liar : mirrors_[m].gone) = true;
    mirrors_[m].share.dropped = why;
    revive();
  }
  /// `that_delivers`: that has shown that it does.
  bool another_is_alive(std::uint32_t but, bool that_delivers = false) const {
    for (std::size_t m = 0; m < mirrors_.size(); ++m)
      if (m != but && mirrors_[m].alive && (mirrors_[m].has_delivered || !that_delivers)) return true;
    return false;
  }
  std::vector<MirrorShare> shares() const {
    std::vector<MirrorShare> out;
    for (const Mirror& m : mirrors_) {
      out.push_back(m.share);
      out.back().bytes_s = m.throughput.recent_bytes_s(kSamples);
    }
    return out;
  }
  /// It is asked again no sooner than after a pause: its own, or one that grows from failure to failure.
  void pause(std::uint32_t m, double now_s, double wait_s) {
    Mirror& mirror = mirrors_[m];
    const double growing_s = kFirstPause_s * static_cast<double>(1 << std::min(mirror.failures++, 6));
    mirror.ready_s = std::max(mirror.ready_s, now_s + std::min(kMostPause_s, std::max(wait_s, growing_s)));
  }

 private:
  struct Mirror {
    Throughput throughput;
    double owed_bytes = 0, last_s = 0, ready_s = 0;
    int failures = 0;
    bool alive = true, gone = false, liar = false, has_delivered = false;
    MirrorShare share{};
  };
  /// Where none is left, those are asked again that may still deliver, liars last.
  void revive() {
    for (const bool liars : {false, true}) {
      if (std::ranges::any_of(mirrors_, &Mirror::alive)) return;
      for (Mirror& mirror : mirrors_) {
        mirror.alive = !mirror.gone && (liars || !mirror.liar);
        if (mirror.alive) mirror.share.dropped.clear();
      }
    }
  }
  std::optional<std::uint32_t> best_of(double bytes, std::optional<std::uint32_t> but, double now_s,
                                       const Lacks& lacks) const {
    std::optional<std::uint32_t> best;
    double best_s = 0;
    for (std::size_t m = 0; m < mirrors_.size(); ++m) {
      const Mirror& mirror = mirrors_[m];
      if (!mirror.alive || (but && *but == m) || lacks(static_cast<std::uint32_t>(m))) continue;
      const double s = (mirror.owed_bytes + bytes) / mirror.throughput.recent_bytes_s(kSamples) +
                       std::max(0.0, mirror.ready_s - now_s);
      if (!best || s < best_s) best = static_cast<std::uint32_t>(m), best_s = s;
    }
    return best;
  }
  std::vector<Mirror> mirrors_;
};

struct PendingRequest {
  TransferRequest request;
  std::uint32_t mirror = 0;
  double at_s = 0, patience_s = 0;
  int tries = 0;
  double received = 0;  // when last looked at
  double kept = 0;      // by the transport, of tries that broke
  bool mixed = false;   // kept bytes may be another mirror's
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
      if (over()) {
        stop();
        break;
      }
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
    end_.mirrors = mirrors_.shares();
    return end_;
  }

 private:
  bool over() {
    end_.cancelled = options_.cancelled && options_.cancelled();
    end_.out_of_time = transport_.now_s() > options_.until_s;
    return end_.cancelled || end_.out_of_time;
  }
  void stop() {
    for (const auto& [number, a] : asked_) transport_.cancel(number);
    end_.unfinished = static_cast<std::uint32_t>(asked_.size() + waiting_.size());
    for (const auto& [number, a] : asked_) source_.failed(number, transport_.now_s());
    for (const PendingRequest& a : waiting_) source_.failed(a.request.number, transport_.now_s());
  }
  /// No server will ever answer.
  void give_up_all() {
    end_.dead = true;
    const auto dead = std::exchange(asked_, {});
    for (const auto& [number, a] : dead) {
      transport_.cancel(number);
      mirrors_.released(a.mirror, static_cast<double>(a.request.bytes));
      give_up(a, "no answer");
    }
  }
  void give_up(const PendingRequest& a, const std::string& why) {
    ++end_.problems[why];
    ++end_.given_up;
    source_.failed(a.request.number, transport_.now_s());
  }

  /// Asks a mirror, or notes that one is to be asked when its pause is over.
  void ask(PendingRequest a, std::optional<std::uint32_t> but) {
    const double now_s = transport_.now_s();
    const auto bytes = static_cast<double>(a.request.bytes);
    const auto mirror = mirrors_.choose(bytes, but, now_s, [&](std::uint32_t m) {
      return lacking_.contains({m, entry_of(a)});
    });
    if (!mirror) {
      give_up(a, "no server is left that has it");
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
    a.received = transport_.received(a.request.number);
    a.mixed = a.received > 0;
    ++a.tries;
    transport_.start(a.request, a.mirror);
    asked_[a.request.number] = std::move(a);
  }
  void start_waiting() {
    const double now_s = transport_.now_s();
    std::vector<PendingRequest> due;
    std::erase_if(waiting_, [&](PendingRequest& a) {
      if (a.at_s > now_s) return false;
      due.push_back(std::move(a));
      return true;
    });
    for (PendingRequest& a : due) ask(std::move(a), {});
  }

  double next_look_s() const {
    double until =
        options_.until_s < kForEver_s ? std::max(options_.until_s, transport_.now_s()) + 1e-3 : kForEver_s;
    if (transport_.mirrors() > 1)  // a single one can only be waited for
      for (const auto& [number, a] : asked_) until = std::min(until, a.at_s + a.patience_s);
    for (const PendingRequest& a : waiting_) until = std::min(until, a.at_s);
    if (options_.cancelled) until = std::min(until, transport_.now_s() + kAskCancelled_s);
    return until;
  }

  void end_try(const Transport::Outcome& outcome) {
    const auto it = asked_.find(outcome.number);
    if (it == asked_.end()) return;
    PendingRequest a = std::move(it->second);
    asked_.erase(it);
    const auto bytes = static_cast<double>(a.request.bytes);
    if (outcome.good && source_.arrived(outcome)) {
      mirrors_.delivered(a.mirror, bytes, a.at_s + options_.rtt_s, outcome.time_s);
      end_.last_s = outcome.time_s;
      return;
    }
    const std::string why = outcome.good ? kLie : outcome.problem;
    if (outcome.wait_s > 0) mirrors_.pause(a.mirror, outcome.time_s, outcome.wait_s);
    if (outcome.absent) {
      note_lacking(std::move(a), why);
      return;
    }
    const bool lied = outcome.lied || (outcome.good && !a.mixed);
    if (lied) transport_.forget(a.request.number);
    const bool drop = outcome.for_good || lied;
    const std::uint32_t by = a.mirror;
    if (drop) mirrors_.drop(by, why, lied);
    retry_or_give_up(std::move(a), why);
    if (drop && mirrors_.another_is_alive(by)) deal_anew(by, lied);
  }
  /// Another mirror may have the entry: that is no failure.
  void note_lacking(PendingRequest a, const std::string& why) {
    const std::uint32_t by = a.mirror;
    mirrors_.released(by, static_cast<double>(a.request.bytes));
    lacking_.insert({by, entry_of(a)});
    ++end_.problems[why];
    --a.tries;
    ask(std::move(a), by);
  }
  /// What a dropped mirror still owes goes to the others. What a liar has brought of it counts for nothing.
  void deal_anew(std::uint32_t mirror, bool lied) {
    std::vector<PendingRequest> owed;
    for (const auto& [number, a] : asked_)
      if (a.mirror == mirror) owed.push_back(a);
    for (PendingRequest& a : owed) {
      lied ? transport_.forget(a.request.number) : transport_.cancel(a.request.number);
      asked_.erase(a.request.number);
      mirrors_.released(mirror, static_cast<double>(a.request.bytes));
      --a.tries;
      ask(std::move(a), mirror);
    }
  }
  /// By which mirrors are told apart that have it: the first entry; models have requests alone.
  static std::uint64_t entry_of(const PendingRequest& a) {
    return a.request.parts.empty() ? a.request.number : a.request.parts.front().entry.offset;
  }
  void retry_or_give_up(PendingRequest a, const std::string& why) {
    mirrors_.released(a.mirror, static_cast<double>(a.request.bytes));
    mirrors_.failed(a.mirror);
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
    std::vector<PendingRequest> late;
    for (auto& [number, a] : asked_) {
      if (a.at_s + a.patience_s > transport_.now_s()) continue;
      // Slow, but nobody is known to be faster.
      const double received = transport_.received(number);
      if (received > a.received && !mirrors_.another_is_alive(a.mirror, true)) {
        a.received = received;
        a.at_s = transport_.now_s();
        continue;
      }
      late.push_back(a);
    }
    for (PendingRequest& a : late) {
      const double come = transport_.received(a.request.number) - a.received;
      if (come >= kProgressBytes) {
        move_elsewhere(std::move(a), come);
        continue;
      }
      transport_.cancel(a.request.number);
      asked_.erase(a.request.number);
      retry_or_give_up(std::move(a), "no answer in time");
    }
  }
  /// A mirror that is slower than was thought keeps what it can deliver: by its new estimate it gets less.
  void move_elsewhere(PendingRequest a, double come) {
    const auto beside =
        std::ranges::count_if(asked_, [&](const auto& other) { return other.second.mirror == a.mirror; });
    mirrors_.slow(a.mirror, come * static_cast<double>(beside), transport_.now_s() - a.at_s);
    transport_.cancel(a.request.number);
    asked_.erase(a.request.number);
    mirrors_.released(a.mirror, static_cast<double>(a.request.bytes));
    ++end_.problems["too slow, asked elsewhere"];
    --a.tries;
    const std::uint32_t from = a.mirror;
    ask(std::move(a), from);
  }

  RequestSource& source_;
  Transport& transport_;
  TransferOptions options_;
  Mirrors mirrors_;
  std::map<std::uint32_t, PendingRequest> asked_;
  std::vector<PendingRequest> waiting_;                        // for the end of their mirror's pause, at_s
  std::set<std::pair<std::uint32_t, std::uint64_t>> lacking_;  // mirror and entry
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
