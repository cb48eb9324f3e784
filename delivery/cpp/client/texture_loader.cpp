#include "delivery/cpp/client/texture_loader.h"

#include "delivery/cpp/decide/request_groups.h"

namespace texmesh {
namespace {

constexpr double kGraceShare = 0.1, kLeastGrace_s = 0.5, kGraceRtts = 8;

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
  using Parts = PlanSource::Parts;
  using Accept = PlanSource::Accept;
  UpgradeSource(std::vector<Upgrade> upgrades, std::size_t offers, std::uint64_t bytes, int window,
                Parts parts, Accept accept)
      : upgrades_(std::move(upgrades)),
        busy_(offers, false),
        dead_(offers, false),
        rung_(offers, -1),
        bytes_left_(bytes),
        window_(window),
        parts_(std::move(parts)),
        accept_(std::move(accept)) {}

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
    if (!accept_(outcome.number, rung_[outcome.number], outcome)) return false;
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
  Accept accept_;
};

TransferOptions transfer_options(const LoadOptions& options) {
  TransferOptions how;
  how.rtt_s = options.htc.rtt_s;
  how.initial_bytes_s = options.htc.initial_bytes_s;
  how.tries = options.tries;
  how.cancelled = options.cancelled;
  return how;
}

LoadReport report_of(const TransferEnd& end) {
  LoadReport report;
  report.cancelled = end.cancelled;
  report.out_of_time = end.out_of_time;
  report.problems = end.problems;
  report.mirrors = end.mirrors;
  if (end.out_of_time && end.unfinished > 0)
    report.problems["not there when the time was over"] = end.unfinished;
  return report;
}

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
    join(w.offer, f.offer);
    w.fragments.push_back(f.fragments[0]);
  }
  std::vector<Wanted> out;
  for (auto& [plane, w] : planes) out.push_back(std::move(w));
  return out;
}

/// Whether a fragment stands directly behind those of w, in every pack that is offered.
bool TextureLoader::follows(const Wanted& w, std::uint32_t fragment) {
  const PlaneTables& t = package_.tables().planes[w.plane];
  for (auto r = static_cast<std::uint32_t>(w.first_rung); r < t.rung_count(); ++r) {
    const ByteRange last = package_.fragment_range(w.plane, r, w.fragments.back());
    if (package_.fragment_range(w.plane, r, fragment).offset != last.offset + last.bytes) return false;
  }
  return true;
}

std::vector<TextureLoader::Wanted> TextureLoader::join_neighbours(std::vector<Wanted> fragments,
                                                                  double bytes_each, double budget) {
  double planned = 1;
  for (const Wanted& f : fragments) planned += f.offer.planned_bytes;
  std::vector<Wanted> out;
  double open = 0;  // expected bytes of the last group
  for (Wanted& f : fragments) {
    const double expected =
        std::clamp(f.offer.planned_bytes * budget / planned, static_cast<double>(f.offer.bytes.front()),
                   static_cast<double>(std::max(f.offer.bytes.front(), f.offer.bytes.back())));
    if (out.empty() || out.back().plane != f.plane || out.back().first_rung != f.first_rung ||
        open + expected > bytes_each || !follows(out.back(), f.fragments[0])) {
      out.push_back(std::move(f));
      open = expected;
      continue;
    }
    join(out.back().offer, f.offer);
    out.back().fragments.push_back(f.fragments[0]);
    open += expected;
  }
  return out;
}

std::vector<PackagePart> TextureLoader::parts_of(const Wanted& w, std::int32_t rung) {
  std::vector<PackagePart> parts;
  const bool incremental = is_incremental(package_, w.plane);
  const std::vector<EntryRef>& rungs = package_.textures()[w.plane].rungs;
  for (std::int32_t r = incremental ? w.first_rung : rung; r <= rung; ++r) {
    const auto at = static_cast<std::uint32_t>(r);
    ByteRange range{0, rungs[at].bytes};
    if (!whole_rungs_) {
      range = package_.fragment_range(w.plane, at, w.fragments.front());
      const ByteRange last = package_.fragment_range(w.plane, at, w.fragments.back());
      range.bytes = last.offset + last.bytes - range.offset;
    }
    if (range.bytes > 0) parts.push_back({rungs[at], range});
  }
  return parts;
}

/// Keeps the fragments that are as they should be; false when not all of them are.
bool TextureLoader::keep_sound_fragments(const Wanted& w, std::int32_t rung,
                                         const Transport::Outcome& outcome,
                                         const std::function<void(const LoadedFragment&)>& on_fragment) {
  const PlaneTables& t = package_.tables().planes[w.plane];
  const bool incremental = is_incremental(package_, w.plane);
  const std::vector<PackagePart> asked = parts_of(w, rung);
  bool all = true;
  for (const std::uint32_t f : w.fragments) {
    LoadedFragment fragment{w.plane, f, rung, {}};
    std::uint64_t bytes = 0;
    std::size_t part = 0;
    bool good = true;
    for (std::int32_t r = incremental ? w.first_rung : rung; r <= rung && good; ++r) {
      const auto at = static_cast<std::uint32_t>(r);
      const ByteRange range = package_.fragment_range(w.plane, at, f);
      if (range.bytes == 0) continue;
      good = part < outcome.parts.size() && outcome.parts[part].size() == asked[part].range.bytes;
      if (!good) break;
      const auto stream = ByteSpan(outcome.parts[part])
                              .subspan(static_cast<std::size_t>(range.offset - asked[part].range.offset),
                                       static_cast<std::size_t>(range.bytes));
      ++part;
      good = truncated(sha256(stream)) == t.digest[at * t.fragment_count() + f];
      fragment.streams.emplace_back(stream.begin(), stream.end());
      bytes += stream.size();
    }
    all = all && good;
    if (!good || held_[w.plane][f] >= rung) continue;  // or it came with a try of which the rest was wrong
    bytes_ += bytes;
    held_[w.plane][f] = rung;
    if (on_fragment) on_fragment(fragment);
  }
  return all;
}

LoadReport TextureLoader::load(const std::vector<PlaneChoice>& planes, const LoadOptions& options) {
  std::vector<Wanted> wanted = this->wanted(planes, options.list);
  const double initial_bytes_s = options.htc.initial_bytes_s;
  if (options.group_bytes > 0 && !whole_rungs_)
    wanted =
        join_neighbours(std::move(wanted), options.group_bytes, initial_bytes_s * options.htc.time_limit_s);
  std::vector<FragmentOffer> offers;
  for (const Wanted& w : wanted) offers.push_back(w.offer);
  HtcOptions htc = options.htc;
  htc.sites = static_cast<int>(std::clamp<std::size_t>(transport_.mirrors(), 1, 64));
  HarmonicTimePlan plan(std::move(offers), htc);
  const double start_s = transport_.now_s();
  PlanSource source(
      plan, start_s,
      [&](std::uint32_t i, std::int32_t rung) { return parts_of(wanted[i], wanted[i].first_rung + rung); },
      [&](std::uint32_t i, std::int32_t rung, const Transport::Outcome& outcome) {
        return keep_sound_fragments(wanted[i], wanted[i].first_rung + rung, outcome, options.on_fragment);
      });
  TransferOptions how = transfer_options(options);
  const double limit_s = options.htc.time_limit_s;
  const double grace_s =
      options.grace_s >= 0 ? options.grace_s
                           : std::max({kLeastGrace_s, kGraceRtts * options.htc.rtt_s, kGraceShare * limit_s});
  how.until_s = start_s + limit_s + grace_s;
  const TransferEnd end = transfer(source, transport_, how);
  LoadReport report = report_of(end);
  const double end_s = end.out_of_time ? transport_.now_s() : end.last_s;
  report.transfer = result_of(plan, limit_s, std::max(0.0, end_s - start_s));
  count_fragments(plan, wanted, report);
  // Rungs as the package counts them.
  for (std::size_t i = 0; i < wanted.size(); ++i)
    report.transfer.rungs[i] = held_[wanted[i].plane][wanted[i].fragments[0]];
  return report;
}

/// What became of the fragments behind the offers.
void TextureLoader::count_fragments(const HarmonicTimePlan& plan, const std::vector<Wanted>& wanted,
                                    LoadReport& report) const {
  const auto lacking = [&](const Wanted& w) {
    return static_cast<std::uint32_t>(std::ranges::count_if(
        w.fragments, [&](std::uint32_t f) { return held_[w.plane][f] < w.first_rung; }));
  };
  std::vector<bool> asked(wanted.size(), false);
  for (const HtcStep& s : plan.steps())
    if (s.bytes > 0) {
      asked[s.offer] = true;
      if (s.rung < 0 && !report.cancelled) report.given_up += lacking(wanted[s.offer]);
    }
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    report.fragments += static_cast<std::uint32_t>(wanted[i].fragments.size());
    if (!asked[i]) report.skipped += lacking(wanted[i]);
  }
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
        if (!keep_sound_fragments(now[i], to, outcome, options.on_fragment)) return false;
        now[i].first_rung = to + 1;
        return true;
      });
  TransferOptions how = transfer_options(options);
  how.until_s = start_s + limits.seconds;
  const TransferEnd end = transfer(source, transport_, how);
  LoadReport report = report_of(end);
  report.given_up = end.given_up;
  report.fragments = static_cast<std::uint32_t>(wanted.size());
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
