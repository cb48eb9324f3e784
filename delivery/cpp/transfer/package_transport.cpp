#include "delivery/cpp/transfer/transfer.h"

#include <chrono>
#include <deque>
#include <thread>

namespace texmesh {
namespace {

constexpr std::uint32_t kMaxParts = 256;    // of a request; more would not fit the pool's numbers
constexpr std::uint64_t kLeastPart = 1024;  // a server may send less than was asked for, but no fewer bytes
constexpr double kBusyWait_s = 0.1;         // of a server that has too much to do, if it names no time

double seconds_on(std::optional<std::chrono::steady_clock::time_point>& start) {
  const auto now = std::chrono::steady_clock::now();
  if (!start) start = now;
  return std::chrono::duration<double>(now - *start).count();
}

class HttpTransport final : public Transport {
 public:
  HttpTransport(const std::vector<std::string>& mirrors, const TransportOptions& options)
      : pool_(options.http, options.connections) {
    for (const std::string& m : mirrors) {
      if (!is_url(m)) throw InputError(m, "", "an http or https URL", "another text");
      const auto etag = options.etags.find(m);
      mirrors_.push_back({m, m.ends_with('/'), etag == options.etags.end() ? "" : etag->second, 0});
    }
    if (mirrors_.empty()) throw InputError("mirrors", "", "at least one URL", "none");
  }
  std::size_t mirrors() const override { return mirrors_.size(); }
  double now_s() override { return seconds_on(start_); }

  void start(const TransferRequest& request, std::uint32_t mirror) override {
    now_s();
    stop(request.number);
    if (request.parts.empty() || request.parts.size() > kMaxParts) {
      broken_.push_back(request.number);
      return;
    }
    Open& open = open_[request.number];
    if (open.wanted != request.parts) {  // another request of the same number
      open = {};
      open.wanted = request.parts;
      open.parts.resize(request.parts.size());
    }
    open.under_way = true;
    open.mirror = mirror;
    open.left = 0;
    for (std::uint32_t i = 0; i < request.parts.size(); ++i)
      if (open.parts[i].size() < request.parts[i].range.bytes) {
        ++open.left;
        ask(request.number, i, open);
      }
    if (open.left == 0) {  // all is here: it can only be wrong
      open.parts.assign(request.parts.size(), {});
      open.left = request.parts.size();
      for (std::uint32_t i = 0; i < request.parts.size(); ++i) ask(request.number, i, open);
    }
  }

  void cancel(std::uint32_t number) override {
    std::erase(broken_, number);
    stop(number);
  }

  void forget(std::uint32_t number) override {
    cancel(number);
    open_.erase(number);
  }

  double received(std::uint32_t number) override {
    const auto it = open_.find(number);
    if (it == open_.end()) return 0;
    double bytes = 0;
    for (std::uint32_t i = 0; i < it->second.parts.size(); ++i) {
      bytes += static_cast<double>(it->second.parts[i].size());
      if (const HttpAnswer* a = pool_.so_far(number_of(number, i)))
        bytes += static_cast<double>(a->body.size());
    }
    return bytes;
  }

  std::optional<Outcome> wait(double until_s) override {
    for (;;) {
      if (!broken_.empty()) {
        const std::uint32_t number = broken_.front();
        cancel(number);
        return Outcome{number, now_s(), false, {}, "it cannot be asked for", 0, true};
      }
      const double left_s = until_s - now_s();
      if (pool_.idle() && until_s < kForEver_s && left_s > 0)
        std::this_thread::sleep_for(std::chrono::duration<double>(left_s));
      auto ended = pool_.wait(std::clamp(left_s, 0.0, 3600.0));
      if (!ended) {
        if (pool_.idle() || now_s() >= until_s) return std::nullopt;
        continue;
      }
      const auto number = static_cast<std::uint32_t>(ended->number / kMaxParts);
      const auto part = static_cast<std::size_t>(ended->number % kMaxParts);
      const auto it = open_.find(number);
      if (it == open_.end()) continue;
      Outcome outcome{number, now_s(), true, {}, {}, 0, false};
      if (!store_part(it->second, part, std::move(ended->answer), outcome)) {
        if (outcome.problem.empty()) {
          ask(number, part, it->second);
          continue;
        }
        outcome.good = false;
        stop(number);
        return outcome;
      }
      if (--it->second.left > 0) continue;
      outcome.parts = std::move(it->second.parts);
      open_.erase(it);
      return outcome;
    }
  }

 private:
  struct Mirror {
    std::string url;
    bool tree = false;
    std::string etag;         // of a container
    std::uint64_t total = 0;  // its length, 0 = not known
  };
  struct Open {
    std::vector<PackagePart> wanted;
    std::vector<Bytes> parts;  // as much as has come
    std::size_t left = 0;
    std::uint32_t mirror = 0;
    bool under_way = false;
  };
  static std::uint64_t number_of(std::uint32_t request, std::uint32_t part) {
    return static_cast<std::uint64_t>(request) * kMaxParts + part;
  }
  /// Ends what is under way and keeps what it has brought.
  void stop(std::uint32_t number) {
    const auto it = open_.find(number);
    if (it == open_.end() || !it->second.under_way) return;
    Open& open = it->second;
    open.under_way = false;
    for (std::uint32_t i = 0; i < open.parts.size(); ++i) {
      const HttpAnswer* a = pool_.so_far(number_of(number, i));
      if (a && a->status == 0 && a->first && *a->first == place_of(open, i).first)  // its head has come
        open.parts[i].insert(open.parts[i].end(), a->body.begin(), a->body.end());
      pool_.cancel(number_of(number, i));
    }
  }
  /// What is still missing of a part, as bytes of the file that is asked for.
  HttpRange place_of(const Open& open, std::size_t part) const {
    const PackagePart& p = open.wanted[part];
    const std::uint64_t have = open.parts[part].size();
    const std::uint64_t begin = mirrors_[open.mirror].tree ? 0 : p.entry.offset;
    return {begin + p.range.offset + have, p.range.bytes - have, false};
  }
  void ask(std::uint32_t request, std::uint32_t part, const Open& open) {
    const Mirror& mirror = mirrors_[open.mirror];
    const PackagePart& p = open.wanted[part];
    HttpRange range = place_of(open, part);
    const bool whole = mirror.tree && p.range.offset == 0 && range.bytes == p.entry.bytes;
    pool_.start(number_of(request, part), mirror.tree ? mirror.url + p.entry.path : mirror.url,
                whole ? std::nullopt : std::optional(range), range.bytes);
  }
  /// Whether the part is complete now; otherwise the outcome says why not, or nothing where the server has
  /// sent less than was asked for, and the rest is to be asked for.
  bool store_part(Open& open, std::size_t part, HttpAnswer a, Outcome& outcome) {
    const HttpRange asked = place_of(open, part);
    const PackagePart& p = open.wanted[part];
    Mirror& mirror = mirrors_[open.mirror];
    if (a.status == 206 && (!a.first || *a.first != asked.first || *a.last >= asked.first + asked.bytes)) {
      outcome.problem = "another range than was asked for";
      return false;
    }
    if (a.status == 206 && !mirror.tree && is_another(mirror, a)) {
      outcome.problem = "the package was replaced by another";
      outcome.for_good = true;
      return false;
    }
    const bool whole = mirror.tree && asked.first == 0 && asked.bytes == p.entry.bytes;
    if (a.status == 206 || (a.status == 200 && whole)) {
      open.parts[part].insert(open.parts[part].end(), a.body.begin(), a.body.end());
      if (a.complete && open.parts[part].size() == p.range.bytes) return true;
      if (a.status == 206 && a.complete && a.body.size() >= kLeastPart &&
          a.body.size() == *a.last - *a.first + 1)
        return false;
      // A server without ranges cannot go on where it was cut.
      if (a.status == 200 || a.too_long) open.parts[part].clear();
      outcome.problem = a.too_long    ? "more bytes than were asked for"
                        : a.complete  ? "fewer bytes than were asked for"
                        : a.timed_out ? "timeout (" + describe_answer(a) + ")"
                                      : "the answer was cut off";
      return false;
    }
    outcome.problem = a.timed_out ? "timeout (" + describe_answer(a) + ")" : describe_answer(a);
    outcome.absent = mirror.tree && (a.status == 404 || a.status == 410);
    if (a.status == 200) {
      outcome.for_good = true;
      outcome.problem = mirror.tree || is_same_file(a, mirror.etag, mirror.total)
                            ? "status 200: the server knows no ranges"
                            : "status 200: the package was replaced by another";
    }
    if (a.status == 429 || a.status >= 500 || (a.status == 0 && !a.timed_out))
      outcome.wait_s = std::max(kBusyWait_s, a.retry_after_s);
    return false;
  }
  static bool is_another(Mirror& mirror, const HttpAnswer& a) {
    // Another ETag alone is no proof: servers behind one name may each have their own. Each part is held
    // against a digest of its own before it is used.
    if (!is_same_file(a, a.total ? "" : mirror.etag, mirror.total)) return true;
    if (a.total) mirror.total = *a.total;
    if (mirror.etag.empty()) mirror.etag = a.etag;
    return false;
  }

  std::vector<Mirror> mirrors_;
  HttpPool pool_;
  std::optional<std::chrono::steady_clock::time_point> start_;
  std::map<std::uint32_t, Open> open_;
  std::vector<std::uint32_t> broken_;  // requests that cannot be asked
};

class StoreTransport final : public Transport {
 public:
  explicit StoreTransport(PackageStore& store) : store_(store) {}
  std::size_t mirrors() const override { return 1; }
  double now_s() override { return seconds_on(start_); }
  void start(const TransferRequest& request, std::uint32_t) override { asked_.push_back(request); }
  void cancel(std::uint32_t number) override {
    std::erase_if(asked_, [&](const TransferRequest& r) { return r.number == number; });
  }
  std::optional<Outcome> wait(double until_s) override {
    if (asked_.empty()) {
      if (until_s < kForEver_s && until_s > now_s())
        std::this_thread::sleep_for(std::chrono::duration<double>(until_s - now_s()));
      return std::nullopt;
    }
    const TransferRequest request = std::move(asked_.front());
    asked_.pop_front();
    Outcome outcome{request.number, 0, true, {}, {}, 0, false};
    try {
      for (const PackagePart& p : request.parts)
        outcome.parts.push_back(store_.read(p.entry, p.range.offset, p.range.bytes));
    } catch (const FormatError& e) {
      outcome.good = false;
      outcome.for_good = true;
      outcome.problem = e.what();
    }
    outcome.time_s = now_s();
    return outcome;
  }

 private:
  PackageStore& store_;
  std::optional<std::chrono::steady_clock::time_point> start_;
  std::deque<TransferRequest> asked_;
};

}  // namespace

std::unique_ptr<Transport> open_transport(const std::vector<std::string>& mirrors,
                                          const TransportOptions& options) {
  return std::make_unique<HttpTransport>(mirrors, options);
}

std::unique_ptr<Transport> open_transport(PackageStore& store) {
  return std::make_unique<StoreTransport>(store);
}

}  // namespace texmesh
