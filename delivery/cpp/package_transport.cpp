#include "delivery/cpp/package_transport.h"

#include <algorithm>
#include <chrono>
#include <map>

#include "format/container.h"
#include "format/errors.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kMaxParts = 256;  // of a request; more would not fit the pool's numbers

class HttpTransport final : public Transport {
 public:
  HttpTransport(std::vector<std::string> mirrors, const TransportOptions& options)
      : mirrors_(std::move(mirrors)), pool_(options.http, options.connections) {
    for (const std::string& m : mirrors_)
      if (!is_url(m)) throw InputError(m, "", "an http or https URL", "another text");
    if (mirrors_.empty()) throw InputError("mirrors", "", "at least one URL", "none");
  }
  std::size_t mirrors() const override { return mirrors_.size(); }
  double now_s() override {
    const auto now = std::chrono::steady_clock::now();
    if (!start_) start_ = now;
    return std::chrono::duration<double>(now - *start_).count();
  }

  void start(const TransferRequest& request, std::uint32_t mirror) override {
    now_s();
    cancel(request.number);
    if (request.parts.empty() || request.parts.size() > kMaxParts) {
      broken_.push_back(request.number);
      return;
    }
    Open open;
    open.parts.resize(request.parts.size());
    open.wanted = request.parts;
    for (std::uint32_t i = 0; i < request.parts.size(); ++i)
      ask(request.number, i, mirrors_[mirror], request.parts[i]);
    open.left = request.parts.size();
    open_[request.number] = std::move(open);
  }

  void cancel(std::uint32_t number) override {
    std::erase(broken_, number);
    const auto it = open_.find(number);
    if (it == open_.end()) return;
    for (std::uint32_t i = 0; i < it->second.parts.size(); ++i) pool_.cancel(number_of(number, i));
    open_.erase(it);
  }

  std::optional<Outcome> wait(double until_s) override {
    for (;;) {
      if (!broken_.empty()) return fail(broken_.front());
      const double left_s = until_s - now_s();
      auto ended = pool_.wait(std::clamp(left_s, 0.0, 3600.0));
      if (!ended) {
        if (pool_.idle() || now_s() >= until_s) return std::nullopt;
        continue;
      }
      const auto number = static_cast<std::uint32_t>(ended->number / kMaxParts);
      const auto part = static_cast<std::size_t>(ended->number % kMaxParts);
      const auto it = open_.find(number);
      if (it == open_.end()) continue;
      if (!keep(it->second, part, std::move(ended->answer))) return fail(number);
      if (--it->second.left > 0) continue;
      Outcome outcome{number, now_s(), true, std::move(it->second.parts), {}, 0, false};
      open_.erase(it);
      return outcome;
    }
  }

 private:
  struct Open {
    std::vector<PackagePart> wanted;
    std::vector<std::vector<std::uint8_t>> parts;
    std::size_t left = 0;
  };
  static std::uint64_t number_of(std::uint32_t request, std::uint32_t part) {
    return static_cast<std::uint64_t>(request) * kMaxParts + part;
  }
  void ask(std::uint32_t request, std::uint32_t part, const std::string& mirror, const PackagePart& p) {
    const bool tree = mirror.ends_with('/');
    const bool whole = tree && p.range.offset == 0 && p.range.bytes == p.entry.bytes;
    const std::uint64_t first = p.range.offset + (tree ? 0 : p.entry.offset);
    pool_.start(number_of(request, part), tree ? mirror + p.entry.path : mirror,
                whole ? std::nullopt : std::optional(HttpRange{first, p.range.bytes}), p.range.bytes);
  }
  /// Whether the answer is the part that was asked for.
  static bool keep(Open& open, std::size_t part, HttpAnswer answer) {
    const PackagePart& p = open.wanted[part];
    if (!answer.complete || answer.body.size() != p.range.bytes) return false;
    if (answer.status == 206 &&
        (!answer.first || *answer.last - *answer.first + 1 != p.range.bytes ||
         (*answer.first != p.range.offset && *answer.first != p.range.offset + p.entry.offset)))
      return false;
    if (answer.status != 206 && answer.status != 200) return false;
    open.parts[part] = std::move(answer.body);
    return true;
  }
  Outcome fail(std::uint32_t number) {
    cancel(number);
    return {number, now_s(), false, {}, "not delivered", 0, false};
  }

  std::vector<std::string> mirrors_;
  HttpPool pool_;
  std::optional<std::chrono::steady_clock::time_point> start_;
  std::map<std::uint32_t, Open> open_;
  std::vector<std::uint32_t> broken_;  // requests that cannot be asked
};

}  // namespace

std::unique_ptr<Transport> open_transport(const std::vector<std::string>& mirrors,
                                          const TransportOptions& options) {
  return std::make_unique<HttpTransport>(mirrors, options);
}

}  // namespace texmesh
