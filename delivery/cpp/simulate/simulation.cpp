#include "delivery/cpp/simulate/simulation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace texmesh {
namespace {

double loss_of(const FragmentOffer& f, std::int32_t rung) {
  return f.loss[static_cast<std::size_t>(rung + 1)];
}

std::int32_t nearest_rung_to(const FragmentOffer& f, double bytes) {
  std::int32_t best = 0;
  for (std::size_t r = 1; r < f.bytes.size(); ++r)
    if (std::abs(f.bytes[r] - bytes) < std::abs(f.bytes[static_cast<std::size_t>(best)] - bytes))
      best = static_cast<std::int32_t>(r);
  return best;
}

}  // namespace

SimulationResult result_of(const HarmonicTimePlan& plan, double limit_s, double end_s) {
  SimulationResult r;
  r.time_limit_s = limit_s;
  r.end_s = end_s;
  r.deviation_percent = 100 * (limit_s - end_s) / limit_s;
  r.late_s = std::max(0.0, end_s - limit_s);
  r.steps = plan.steps();
  r.rungs = plan.rungs();
  for (const HtcStep& s : r.steps) {
    r.bytes += s.rung < 0 ? 0 : s.bytes;
    r.skipped += s.rung < 0;
    r.given_up += s.rung < 0 && s.bytes > 0;
  }
  r.skipped += static_cast<std::uint32_t>(plan.offers().size() - r.steps.size());
  for (std::size_t i = 0; i < r.rungs.size(); ++i) {
    const FragmentOffer& f = plan.offers()[i];
    r.loss += loss_of(f, r.rungs[i]);
    r.planned_loss += loss_of(f, nearest_rung_to(f, f.planned_bytes));
  }
  return r;
}

namespace {

constexpr double kNotInTime = std::numeric_limits<double>::infinity();
constexpr double kFoundDead_s = 0.5;  // what transfer() waits for an answer at least

/// A model of a network as a transport.
class ModelTransport final : public Transport {
 public:
  explicit ModelTransport(const NetworkOptions& network) : model_(network), mirrors_(network.mirrors) {}
  std::size_t mirrors() const override { return mirrors_.size(); }
  double now_s() override { return model_.now_s(); }
  void start(const TransferRequest& request, std::uint32_t mirror) override {
    Part& part = parts_[request.number];
    if (part.left <= 0)
      part = {static_cast<double>(request.bytes), static_cast<double>(request.bytes), mirror};
    part.mirror = mirror;
    model_.request(request.number, mirror, part.left);
  }
  void forget(std::uint32_t number) override {
    model_.cancel(number);
    parts_.erase(number);
  }
  void cancel(std::uint32_t number) override {
    if (const auto left = model_.bytes_left(number)) parts_[number].left = *left;
    model_.cancel(number);
  }
  double received(std::uint32_t number) override {
    const auto part = parts_.find(number);
    if (part == parts_.end()) return 0;
    return part->second.bytes - model_.bytes_left(number).value_or(part->second.left);
  }
  std::optional<Outcome> wait(double until_s) override {
    const auto arrival = model_.advance(until_s);
    if (!arrival) return std::nullopt;
    Outcome outcome{arrival->request, arrival->time_s, true, {}, {}, 0, false};
    const auto part = parts_.find(arrival->request);
    if (mirrors_[part->second.mirror].lies_from_s <= arrival->time_s) {
      outcome.good = false;
      outcome.lied = true;
      outcome.problem = "bytes of another digest";
    }
    parts_.erase(part);
    return outcome;
  }
  void move_to(double time_s) {
    while (model_.now_s() < time_s) model_.advance(time_s);
  }

 private:
  struct Part {
    double bytes = 0, left = 0;
    std::uint32_t mirror = 0;
  };
  NetworkModel model_;
  std::vector<MirrorModel> mirrors_;
  std::map<std::uint32_t, Part> parts_;  // by request, of what is still to come
};

/// One request and nothing more.
class OneRequest final : public RequestSource {
 public:
  explicit OneRequest(std::uint64_t bytes) : bytes_(bytes) {}
  std::optional<TransferRequest> next(double) override {
    if (std::exchange(asked_, true)) return std::nullopt;
    return TransferRequest{0, bytes_, {}};
  }
  bool arrived(const Transport::Outcome&) override { return ended_ = true; }
  void failed(std::uint32_t, double) override { ended_ = true; }
  bool finished() const override { return ended_; }

 private:
  std::uint64_t bytes_;
  bool asked_ = false, ended_ = false;
};

}  // namespace

SimulationResult simulate(std::vector<FragmentOffer> offers, const HtcOptions& options,
                          const NetworkOptions& network, const TransportAround& around) {
  HarmonicTimePlan plan(std::move(offers), options);
  ModelTransport model(network);
  PlanSource source(plan);
  TransferOptions how;
  how.rtt_s = network.rtt_s;
  how.initial_bytes_s = options.initial_bytes_s;
  const TransferEnd end = transfer(source, around ? around(model) : model, how);
  SimulationResult result = result_of(plan, options.time_limit_s, end.given_up > 0 ? kNotInTime : end.last_s);
  result.never = end.given_up > 0;
  result.mirrors = end.mirrors;
  return result;
}

NetworkOptions without_dead_mirrors(NetworkOptions network, double now_s) {
  const auto dead = [now_s](const MirrorModel& m) { return m.dead_from_s + kFoundDead_s <= now_s; };
  if (!std::ranges::all_of(network.mirrors, dead)) std::erase_if(network.mirrors, dead);
  return network;
}

namespace {

BandwidthTrace trace_from(const BandwidthTrace& trace, double by_s) {
  BandwidthTrace out{{0}, {trace.at(by_s)}};
  for (std::size_t i = 0; i < trace.time_s.size(); ++i)
    if (trace.time_s[i] > by_s) {
      out.time_s.push_back(trace.time_s[i] - by_s);
      out.bytes_s.push_back(trace.bytes_s[i]);
    }
  return out;
}

}  // namespace

NetworkOptions network_from(NetworkOptions network, double by_s) {
  network.link = trace_from(network.link, by_s);
  for (MirrorModel& m : network.mirrors) {
    m.rate = trace_from(m.rate, by_s);
    m.dead_from_s = std::max(0.0, m.dead_from_s - by_s);
    m.lies_from_s = std::max(0.0, m.lies_from_s - by_s);
  }
  return network;
}

double fetched_s(const NetworkOptions& all, double from_s, std::uint64_t bytes) {
  if (!std::isfinite(from_s)) return kNotInTime;
  const NetworkOptions network = without_dead_mirrors(all, from_s);
  ModelTransport transport(network);
  transport.move_to(from_s);
  OneRequest source(bytes);
  TransferOptions how;
  how.rtt_s = network.rtt_s;
  // A client knows by then about how fast its link and its best server are.
  double best = 0;
  for (const MirrorModel& m : network.mirrors) best = std::max(best, m.rate.at(from_s));
  how.initial_bytes_s = std::max(1.0, std::min(best, network.link.at(from_s)));
  const TransferEnd end = transfer(source, transport, how);
  return end.given_up > 0 ? kNotInTime : end.last_s;
}

}  // namespace texmesh
