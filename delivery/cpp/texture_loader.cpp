#include "delivery/cpp/texture_loader.h"

#include <algorithm>
#include <map>
#include <utility>

namespace texmesh {
namespace {

using Bytes = std::vector<std::uint8_t>;

bool is_incremental(PackageReader& package, std::uint32_t plane) {
  return codec_traits(package.textures()[plane].codec).incremental;
}

/// What is left to offer of a fragment of which a rung is held: the rungs above it, and the held one's loss
/// as what is lost when nothing more comes.
FragmentOffer above(const FragmentOffer& f, std::int32_t held, bool incremental) {
  const auto skip = static_cast<std::ptrdiff_t>(held + 1);
  FragmentOffer out;
  out.bytes.assign(f.bytes.begin() + skip, f.bytes.end());
  out.loss.assign(f.loss.begin() + skip, f.loss.end());
  const std::uint32_t have = held >= 0 && incremental ? f.bytes[static_cast<std::size_t>(held)] : 0;
  for (std::uint32_t& b : out.bytes) b = b > have ? b - have : 1;
  out.eta = f.eta;
  out.planned_bytes = std::max(1.0, f.planned_bytes - have);
  const auto less = [skip](std::uint16_t rung) {
    return static_cast<std::uint16_t>(rung > skip ? rung - skip : 0);
  };
  out.low_rung = less(f.low_rung);
  out.high_rung = less(f.high_rung);
  return out;
}

/// The upgrades that are left, asked for in order with a few requests in flight.
class UpgradeSource final : public RequestSource {
 public:
  using Parts = std::function<std::vector<PackagePart>(std::uint32_t, std::int32_t)>;
  using Take = std::function<bool(std::uint32_t, std::int32_t, const Transport::Outcome&)>;
  UpgradeSource(std::vector<Upgrade> upgrades, std::size_t offers, std::uint64_t bytes, int window,
                Parts parts, Take take)
      : upgrades_(std::move(upgrades)),
        busy_(offers, false),
        dead_(offers, false),
        rung_(offers, -1),
        bytes_left_(bytes),
        window_(window),
        parts_(std::move(parts)),
        take_(std::move(take)) {}

  std::optional<TransferRequest> next(double) override {
    if (in_flight_ >= window_) return std::nullopt;
    for (std::size_t i = at_; i < upgrades_.size(); ++i) {
      Upgrade& u = upgrades_[i];
      if (u.bytes == 0 || busy_[u.offer]) continue;  // done, or the rung before is still on its way
      if (dead_[u.offer] || u.bytes > bytes_left_) {
        dead_[u.offer] = true;
        u.bytes = 0;
        continue;
      }
      const TransferRequest request{u.offer, u.bytes, parts_(u.offer, u.rung)};
      bytes_left_ -= u.bytes;
      busy_[u.offer] = true;
      rung_[u.offer] = u.rung;
      u.bytes = 0;
      ++in_flight_;
      while (at_ < upgrades_.size() && upgrades_[at_].bytes == 0) ++at_;
      return request;
    }
    while (at_ < upgrades_.size() && upgrades_[at_].bytes == 0) ++at_;
    return std::nullopt;
  }
  bool arrived(const Transport::Outcome& outcome) override {
    if (!take_(outcome.number, rung_[outcome.number], outcome)) return false;
    end(outcome.number);
    return true;
  }
  void failed(std::uint32_t number, double) override {
    dead_[number] = true;
    end(number);
  }
  bool finished() const override { return in_flight_ == 0 && at_ >= upgrades_.size(); }

 private:
  void end(std::uint32_t offer) {
    busy_[offer] = false;
    --in_flight_;
  }
  std::vector<Upgrade> upgrades_;
  std::vector<bool> busy_, dead_;  // dead: failed, or beyond the bytes that may be spent
  std::vector<std::int32_t> rung_;
  std::uint64_t bytes_left_;
  int window_, in_flight_ = 0;
  std::size_t at_ = 0;
  Parts parts_;
  Take take_;
};

}  // namespace

TextureLoader::TextureLoader(PackageReader& package, Transport& transport, bool whole_rungs)
    : package_(package), transport_(transport), whole_rungs_(whole_rungs) {
  for (const PlaneTables& t : package.tables().planes) held_.emplace_back(t.fragment_count(), -1);
}

std::vector<TextureLoader::Wanted> TextureLoader::wanted(const std::vector<PlaneChoice>& planes,
                                                         const ListOptions& options) {
  const FragmentList list = fragment_list(package_, planes, options);
  std::vector<Wanted> out;
  for (std::size_t i = 0; i < list.offers.size(); ++i) {
    const auto [plane, fragment] = list.fragments[i];
    const std::int32_t held = held_[plane][fragment];
    if (held + 1 >= static_cast<std::int32_t>(list.offers[i].bytes.size())) continue;
    out.push_back(
        {above(list.offers[i], held, is_incremental(package_, plane)), plane, {fragment}, held + 1});
  }
  return whole_rungs_ ? join_planes(std::move(out)) : out;
}

// A plane's fragments share their rungs here, so all of them have the same one held.
std::vector<TextureLoader::Wanted> TextureLoader::join_planes(std::vector<Wanted> fragments) const {
  std::map<std::uint32_t, Wanted> planes;
  for (const Wanted& f : fragments) {
    const auto [it, is_new] = planes.try_emplace(f.plane, f);
    if (is_new) continue;
    Wanted& w = it->second;
    if (w.first_rung != f.first_rung) continue;
    for (std::size_t r = 0; r < w.offer.bytes.size(); ++r) w.offer.bytes[r] += f.offer.bytes[r];
    for (std::size_t r = 0; r < w.offer.loss.size(); ++r) w.offer.loss[r] += f.offer.loss[r];
    w.offer.eta = std::max(w.offer.eta, f.offer.eta);
    w.offer.planned_bytes += f.offer.planned_bytes;
    w.fragments.push_back(f.fragments[0]);
  }
  std::vector<Wanted> out;
  for (auto& [plane, w] : planes) out.push_back(std::move(w));
  return out;
}

std::vector<PackagePart> TextureLoader::parts_of(const Wanted& w, std::int32_t rung) {
  std::vector<PackagePart> parts;
  const bool incremental = is_incremental(package_, w.plane);
  const std::vector<EntryRef>& rungs = package_.textures()[w.plane].rungs;
  for (std::int32_t r = incremental ? w.first_rung : rung; r <= rung; ++r) {
    const EntryRef& pack = rungs[static_cast<std::size_t>(r)];
    const ByteRange range =
        whole_rungs_ ? ByteRange{0, pack.bytes}
                     : package_.fragment_range(w.plane, static_cast<std::uint32_t>(r), w.fragments[0]);
    if (range.bytes > 0) parts.push_back({pack, range});
  }
  return parts;
}

bool TextureLoader::take(const Wanted& w, std::int32_t rung, const Transport::Outcome& outcome,
                         const std::function<void(const LoadedFragment&)>& on_fragment) {
  const PlaneTables& t = package_.tables().planes[w.plane];
  const bool incremental = is_incremental(package_, w.plane);
  std::vector<LoadedFragment> loaded;
  std::uint64_t bytes = 0;
  for (const std::uint32_t f : w.fragments) {
    LoadedFragment fragment{w.plane, f, rung, {}};
    std::size_t part = 0;
    for (std::int32_t r = incremental ? w.first_rung : rung; r <= rung; ++r) {
      const auto at = static_cast<std::uint32_t>(r);
      const ByteRange range = package_.fragment_range(w.plane, at, f);
      if (range.bytes == 0) continue;
      if (part >= outcome.parts.size()) return false;
      std::span<const std::uint8_t> stream(outcome.parts[part++]);
      if (whole_rungs_)
        stream =
            stream.subspan(static_cast<std::size_t>(range.offset), static_cast<std::size_t>(range.bytes));
      if (truncated(sha256(stream)) != t.digest[at * t.fragment_count() + f]) return false;
      fragment.streams.emplace_back(stream.begin(), stream.end());
      bytes += stream.size();
    }
    loaded.push_back(std::move(fragment));
  }
  bytes_ += bytes;
  for (const LoadedFragment& f : loaded) {
    held_[f.plane][f.fragment] = rung;
    if (on_fragment) on_fragment(f);
  }
  return true;
}

LoadReport TextureLoader::load(const std::vector<PlaneChoice>& planes, const LoadOptions& options) {
  const std::vector<Wanted> wanted = this->wanted(planes, options.list);
  std::vector<FragmentOffer> offers;
  for (const Wanted& w : wanted) offers.push_back(w.offer);
  HarmonicTimePlan plan(std::move(offers), options.htc);
  const double start_s = transport_.now_s();
  PlanSource source(
      plan, start_s,
      [&](std::uint32_t i, std::int32_t rung) { return parts_of(wanted[i], wanted[i].first_rung + rung); },
      [&](std::uint32_t i, std::int32_t rung, const Transport::Outcome& outcome) {
        return take(wanted[i], wanted[i].first_rung + rung, outcome, options.on_fragment);
      });
  TransferOptions how;
  how.rtt_s = options.htc.rtt_s;
  how.initial_bytes_s = options.htc.throughput.initial_bytes_s;
  how.tries = options.tries;
  how.cancelled = options.cancelled;
  const TransferEnd end = transfer(source, transport_, how);
  LoadReport report;
  report.transfer = result_of(plan, options.htc.time_limit_s, std::max(0.0, end.last_s - start_s));
  report.cancelled = end.cancelled;
  report.given_up = end.given_up;
  // Rungs as the package counts them.
  for (std::size_t i = 0; i < wanted.size(); ++i)
    report.transfer.rungs[i] = held_[wanted[i].plane][wanted[i].fragments[0]];
  return report;
}

LoadReport TextureLoader::refine(const std::vector<PlaneChoice>& planes, const LoadOptions& options,
                                 const RefineLimits& limits) {
  const std::vector<Wanted> wanted = this->wanted(planes, options.list);
  std::vector<FragmentOffer> offers;
  for (const Wanted& w : wanted) offers.push_back(w.offer);
  // Offers are what is still missing, so that even incremental ones count from where they stand.
  std::vector<Upgrade> upgrades =
      upgrades_in_order(offers, std::vector<std::int32_t>(offers.size(), -1), false);
  // The rungs between an offer's upgrades are held by then: of incremental codecs only the rest is fetched.
  std::vector<std::int32_t> at(wanted.size(), -1);
  for (Upgrade& u : upgrades) {
    const std::int32_t before = std::exchange(at[u.offer], u.rung);
    if (before >= 0 && is_incremental(package_, wanted[u.offer].plane))
      u.bytes -=
          std::min<std::uint64_t>(u.bytes - 1, offers[u.offer].bytes[static_cast<std::size_t>(before)]);
  }
  std::vector<Wanted> now = wanted;
  const std::uint64_t bytes_before = bytes_;
  const double start_s = transport_.now_s();
  UpgradeSource source(
      std::move(upgrades), offers.size(), limits.bytes, std::max(2, options.htc.window),
      [&](std::uint32_t i, std::int32_t rung) { return parts_of(now[i], wanted[i].first_rung + rung); },
      [&](std::uint32_t i, std::int32_t rung, const Transport::Outcome& outcome) {
        const std::int32_t to = wanted[i].first_rung + rung;
        if (!take(now[i], to, outcome, options.on_fragment)) return false;
        now[i].first_rung = to + 1;
        return true;
      });
  TransferOptions how;
  how.rtt_s = options.htc.rtt_s;
  how.initial_bytes_s = options.htc.throughput.initial_bytes_s;
  how.tries = options.tries;
  how.cancelled = options.cancelled;
  how.until_s = start_s + limits.seconds;
  const TransferEnd end = transfer(source, transport_, how);
  LoadReport report;
  report.cancelled = end.cancelled || end.out_of_time;
  report.given_up = end.given_up;
  report.transfer.time_limit_s = limits.seconds;
  report.transfer.end_s = std::max(0.0, end.last_s - start_s);
  report.transfer.bytes = bytes_ - bytes_before;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const std::int32_t rung = held_[wanted[i].plane][wanted[i].fragments[0]];
    report.transfer.rungs.push_back(rung);
    report.transfer.loss += offers[i].loss[static_cast<std::size_t>(rung - wanted[i].first_rung + 1)];
  }
  return report;
}

}  // namespace texmesh
