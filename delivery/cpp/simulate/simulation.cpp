#include "delivery/cpp/simulate/simulation.h"

#include <charconv>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

constexpr double kNever = 1e300;
constexpr double kPacketBytes = 1460;
constexpr double kForEver = 1e9;  // a time that nobody waits for
constexpr double kDone = 1e-6;    // bytes: what rounding may leave of a transfer

double next_step(const BandwidthTrace& trace, double t_s) {
  const auto it = std::upper_bound(trace.time_s.begin(), trace.time_s.end(), t_s);
  return it == trace.time_s.end() ? kNever : *it;
}

void check(const BandwidthTrace& trace) {
  bool good = !trace.time_s.empty() && trace.time_s.size() == trace.bytes_s.size() && trace.time_s[0] == 0 &&
              trace.bytes_s.back() > 0;
  for (std::size_t i = 0; good && i < trace.time_s.size(); ++i)
    good = trace.bytes_s[i] >= 0 && trace.bytes_s[i] <= 1e15 &&
           (i == 0 || trace.time_s[i] > trace.time_s[i - 1]);
  if (!good) throw std::invalid_argument("BandwidthTrace: times from 0 rising, rates >= 0, the last > 0");
}

/// Water filling: an even share of `capacity` for each, what a capped one leaves going to the others.
void share_evenly(double capacity, const std::vector<double>& caps, std::vector<double>& rates) {
  std::vector<std::size_t> order(caps.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return caps[a] < caps[b]; });
  rates.assign(caps.size(), 0);
  for (std::size_t k = 0; k < order.size(); ++k) {
    const double even = capacity / static_cast<double>(order.size() - k);
    rates[order[k]] = std::min(caps[order[k]], even);
    capacity -= rates[order[k]];
  }
}

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

BandwidthTrace BandwidthTrace::constant(double bytes_s) { return {{0}, {bytes_s}}; }

double BandwidthTrace::at(double t_s) const {
  const auto it = std::upper_bound(time_s.begin(), time_s.end(), t_s);
  return bytes_s[it == time_s.begin() ? 0 : static_cast<std::size_t>(it - time_s.begin()) - 1];
}

double BandwidthTrace::mean(double from_s, double to_s) const {
  double sum = 0;
  for (double t = from_s; t < to_s;) {
    const double end = std::min(next_step(*this, t), to_s);
    sum += at(t) * (end - t);
    t = end;
  }
  return to_s > from_s ? sum / (to_s - from_s) : at(from_s);
}

BandwidthTrace read_trace_csv(std::string_view text, const std::string& name) {
  BandwidthTrace trace{{}, {}};
  std::size_t line_number = 0;
  bool heading_allowed = true;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    ++line_number;
    line.remove_suffix(line.size() - (line.find_last_not_of("\r ") + 1));
    line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
    if (line.empty() || line.front() == '#') continue;
    const std::string place = "line " + std::to_string(line_number);
    double t = 0, rate = 0;
    const auto first = std::from_chars(line.data(), line.data() + line.size(), t);
    std::string_view rest(first.ptr, static_cast<std::size_t>(line.data() + line.size() - first.ptr));
    rest.remove_prefix(std::min(rest.find_first_not_of(", ;"), rest.size()));
    const auto second = std::from_chars(rest.data(), rest.data() + rest.size(), rate);
    const bool numbers =
        first.ec == std::errc() && second.ec == std::errc() && second.ptr == rest.data() + rest.size();
    if (std::exchange(heading_allowed, false) && !numbers) continue;
    if (!numbers || !(t >= 0 && t <= 1e9) || !(rate >= 0 && rate <= 1e15))
      throw InputError(name, place, "seconds,bytes per second", std::string(line.substr(0, 60)));
    if (trace.time_s.empty() ? t != 0 : t <= trace.time_s.back())
      throw InputError(name, place, trace.time_s.empty() ? "time 0 first" : "rising times",
                       std::to_string(t));
    if (trace.time_s.size() >= 10'000'000) throw InputError(name, place, "at most 10000000 lines", "more");
    trace.time_s.push_back(t);
    trace.bytes_s.push_back(rate);
  }
  if (trace.time_s.empty()) throw InputError(name, "", "a line with seconds,bytes per second", "none");
  if (trace.bytes_s.back() <= 0)
    throw InputError(name, "line " + std::to_string(line_number), "a last rate above 0", "0");
  return trace;
}

NetworkModel::NetworkModel(NetworkOptions options)
    : options_(std::move(options)), random_state_(options_.seed * 0x9e3779b97f4a7c15ull + 1) {
  check(options_.link);
  for (const MirrorModel& m : options_.mirrors) check(m.rate);
  if (options_.mirrors.empty() || options_.connections < 1 || options_.rtt_s < 0 || options_.loss < 0 ||
      options_.loss > 0.5)
    throw std::invalid_argument("NetworkModel: mirrors, connections >= 1, rtt >= 0, loss in 0 .. 0.5");
  connections_.assign(options_.mirrors.size(),
                      std::vector<Connection>(static_cast<std::size_t>(options_.connections)));
}

void NetworkModel::request(std::uint32_t number, std::uint32_t mirror, double bytes) {
  if (mirror >= connections_.size()) throw std::invalid_argument("NetworkModel: no such mirror");
  Flow f;
  f.number = number;
  f.mirror = mirror;
  f.bytes_left = std::max(bytes, kDone);
  f.starts_s = kNever;
  flows_.push_back(f);
  start_waiting();
}

void NetworkModel::cancel(std::uint32_t number) {
  for (std::size_t i = 0; i < flows_.size(); ++i)
    if (flows_[i].number == number) {
      if (flows_[i].starts_s < kNever) connections_[flows_[i].mirror][flows_[i].connection] = {};
      flows_.erase(flows_.begin() + static_cast<std::ptrdiff_t>(i));
      break;
    }
  start_waiting();
}

std::optional<double> NetworkModel::bytes_left(std::uint32_t number) const {
  const auto it = std::ranges::find(flows_, number, &Flow::number);
  return it == flows_.end() ? std::nullopt : std::optional(it->bytes_left);
}

bool NetworkModel::dead() const {
  return std::ranges::all_of(flows_,
                             [&](const Flow& f) { return options_.mirrors[f.mirror].dead_from_s <= now_s_; });
}

/// Gives free connections to those who wait, in their order.
void NetworkModel::start_waiting() {
  for (Flow& f : flows_) {
    if (f.starts_s < kNever) continue;
    std::vector<Connection>& pool = connections_[f.mirror];
    // An opened one first: it costs no handshake and its window has grown.
    std::size_t chosen = pool.size();
    for (std::size_t c = 0; c < pool.size(); ++c)
      if (!pool[c].busy && (chosen == pool.size() || (pool[c].opened && !pool[chosen].opened))) chosen = c;
    if (chosen == pool.size()) continue;
    Connection& connection = pool[chosen];
    f.connection = static_cast<std::uint32_t>(chosen);
    f.starts_s = now_s_ + options_.rtt_s * (options_.connect_costs && !connection.opened ? 2 : 1);
    if (options_.loss > 0) f.next_loss = -portable::log(random()) / options_.loss * kPacketBytes;
    connection.busy = connection.opened = true;
    connection.grows_s = options_.slow_start && options_.rtt_s > 0 ? f.starts_s + options_.rtt_s : kNever;
  }
}

bool NetworkModel::active(const Flow& f) const {
  return f.starts_s <= now_s_ && f.paused_until_s <= now_s_ &&
         options_.mirrors[f.mirror].dead_from_s > now_s_;
}

/// Even shares of the link, under the caps of windows and of even shares of each mirror.
void NetworkModel::share_rates() {
  std::vector<double> caps(flows_.size(), 0);
  for (std::size_t m = 0; m < connections_.size(); ++m) {
    std::vector<std::size_t> members;
    std::vector<double> member_caps, rates;
    for (std::size_t i = 0; i < flows_.size(); ++i) {
      const Flow& f = flows_[i];
      if (f.mirror != m || !active(f)) continue;
      members.push_back(i);
      member_caps.push_back(options_.slow_start && options_.rtt_s > 0
                                ? connections_[m][f.connection].window_bytes / options_.rtt_s
                                : kNever);
    }
    share_evenly(options_.mirrors[m].rate.at(now_s_), member_caps, rates);
    for (std::size_t k = 0; k < members.size(); ++k) caps[members[k]] = rates[k];
  }
  std::vector<double> rates;
  std::vector<std::size_t> running;
  std::vector<double> running_caps;
  for (std::size_t i = 0; i < flows_.size(); ++i) {
    flows_[i].rate = 0;
    if (caps[i] <= 0) continue;
    running.push_back(i);
    running_caps.push_back(caps[i]);
  }
  share_evenly(options_.link.at(now_s_), running_caps, rates);
  for (std::size_t k = 0; k < running.size(); ++k) flows_[running[k]].rate = rates[k];
}

double NetworkModel::next_event_s(double until_s) const {
  double next = std::min(until_s, next_step(options_.link, now_s_));
  for (const MirrorModel& m : options_.mirrors) {
    next = std::min(next, next_step(m.rate, now_s_));
    if (m.dead_from_s > now_s_) next = std::min(next, m.dead_from_s);
  }
  for (const Flow& f : flows_) {
    if (f.starts_s > now_s_) next = std::min(next, f.starts_s);
    if (f.paused_until_s > now_s_) next = std::min(next, f.paused_until_s);
    if (f.rate <= 0) continue;
    next = std::min(next, now_s_ + std::min(f.bytes_left, f.next_loss) / f.rate);
    const double grows = connections_[f.mirror][f.connection].grows_s;
    if (grows > now_s_) next = std::min(next, grows);
  }
  return next;
}

void NetworkModel::move_to(double time_s) {
  const double seconds = time_s - now_s_;
  now_s_ = time_s;
  for (Flow& f : flows_) {
    const double moved = f.rate * seconds;
    f.bytes_left -= moved;
    f.next_loss -= moved;
    if (f.starts_s >= kNever) continue;
    Connection& c = connections_[f.mirror][f.connection];
    if (f.next_loss <= kDone && f.bytes_left > kDone) {
      f.paused_until_s = now_s_ + options_.rtt_s;
      f.next_loss = -portable::log(random()) / options_.loss * kPacketBytes;
      c.window_bytes = std::max(2 * kPacketBytes, c.window_bytes / 2);
    }
    if (c.grows_s <= now_s_) {
      c.window_bytes = std::min(2 * c.window_bytes, 1e9);
      c.grows_s = now_s_ + options_.rtt_s;
    }
  }
}

std::optional<NetworkModel::Arrival> NetworkModel::advance(double until_s) {
  for (;;) {
    for (std::size_t i = 0; i < flows_.size(); ++i) {
      const Flow f = flows_[i];
      if (f.bytes_left > kDone) continue;
      connections_[f.mirror][f.connection].busy = false;
      flows_.erase(flows_.begin() + static_cast<std::ptrdiff_t>(i));
      start_waiting();
      return Arrival{f.number, now_s_};
    }
    if (now_s_ >= until_s || (until_s >= kForEver && dead())) return std::nullopt;
    share_rates();
    const double next = next_event_s(until_s);
    if (next >= kNever) return std::nullopt;  // nothing will ever happen
    move_to(next);
    // Rounding may leave a transfer a sliver that no step of time can move.
    for (Flow& f : flows_)
      if (f.rate > 0 && f.bytes_left > 0 && now_s_ + f.bytes_left / f.rate <= now_s_) f.bytes_left = 0;
  }
}

// xorshift64*: 53 bits in (0, 1].
double NetworkModel::random() {
  random_state_ ^= random_state_ >> 12;
  random_state_ ^= random_state_ << 25;
  random_state_ ^= random_state_ >> 27;
  return (static_cast<double>((random_state_ * 0x2545f4914f6cdd1dull) >> 11) + 1.0) / 9007199254740992.0;
}

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
