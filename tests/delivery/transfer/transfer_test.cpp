// Transfers that go wrong, on the model of a network and on a scripted one: every request ends.
#include "delivery/cpp/transfer/transfer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "delivery/cpp/simulate/simulation.h"
#include "tests/delivery/made_links.h"

namespace texmesh::transfer_test {

HtcOptions options(double time_limit_s = 4) {
  HtcOptions o;
  o.time_limit_s = time_limit_s;
  o.initial_bytes_s = 1e6;
  o.rtt_s = 0.02;
  return o;
}
NetworkOptions network(std::vector<MirrorModel> mirrors) {
  NetworkOptions n;
  n.link = BandwidthTrace::constant(1e6);
  n.rtt_s = 0.02;
  n.mirrors = std::move(mirrors);
  return n;
}
MirrorModel mirror(double bytes_s, double dead_from_s = 1e300) {
  return {BandwidthTrace::constant(bytes_s), dead_from_s};
}

void expect_never(const SimulationResult& r) {
  EXPECT_TRUE(r.never);
  EXPECT_GT(r.given_up, 0u);
  EXPECT_GE(r.skipped, r.given_up);
  EXPECT_TRUE(std::isinf(r.end_s) && r.end_s > 0);
  EXPECT_TRUE(std::isinf(r.late_s));
  EXPECT_LT(r.deviation_percent, 0);
  for (const HtcStep& s : r.steps) EXPECT_LT(s.done_s, 1e4);  // nobody waits for ever
}

TEST(Transfer, AServerThatDiesLeavesATransferThatNeverEnds) {
  const SimulationResult r = simulate(testing::photo_offers(), options(), network({mirror(1e6, 1)}));
  expect_never(r);
  EXPECT_GT(r.bytes, 0u);  // what came before counts
  EXPECT_LT(r.bytes, 1'100'000u);
}

TEST(Transfer, ServersThatAllDieEndIt) {
  expect_never(simulate(testing::photo_offers(), options(), network({mirror(1e6, 1), mirror(1e6, 1.2)})));
  HtcOptions hard = options();
  hard.hard_limits = true;
  expect_never(simulate(testing::photo_offers(), hard, network({mirror(1e6, 0), mirror(1e6, 0)})));
}

TEST(Transfer, OneThatLivesDeliversWhatTheDeadOnesOwe) {
  for (const bool first_dies : {true, false}) {
    const SimulationResult r =
        simulate(testing::photo_offers(), options(),
                 network({mirror(1e6, first_dies ? 1 : 1e300), mirror(1e6, first_dies ? 1e300 : 1)}));
    EXPECT_FALSE(r.never);
    EXPECT_EQ(r.given_up, 0u);
    EXPECT_LT(r.late_s, 0.6);
  }
}

TEST(FetchedS, ComesFromAMirrorThatAnswersOrNever) {
  EXPECT_NEAR(fetched_s(network({mirror(1e9)}), 0, 500'000), 0.52, 1e-9);
  EXPECT_NEAR(fetched_s(network({mirror(1e9)}), 2, 500'000), 2.52, 1e-9);
  const double late = fetched_s(network({mirror(1e9, 0), mirror(1e9)}), 0, 500'000);
  EXPECT_GT(late, 0.52);  // the first is waited for
  EXPECT_LT(late, 4);
  EXPECT_NEAR(fetched_s(network({mirror(1e9), mirror(1e9, 0)}), 0, 500'000), 0.52, 1e-9);
  EXPECT_TRUE(std::isinf(fetched_s(network({mirror(1e9, 0)}), 0, 1)));
  EXPECT_TRUE(std::isinf(fetched_s(network({mirror(1e9, 0), mirror(1e9, 0)}), 0, 1)));
  EXPECT_TRUE(std::isinf(fetched_s(network({mirror(1e9)}), INFINITY, 1)));
  // It is not asked again once it is known.
  EXPECT_NEAR(fetched_s(network({mirror(1e9, 0), mirror(1e9)}), late, 500'000), late + 0.52, 1e-9);
  // A server slower than the link is no dead one.
  EXPECT_NEAR(fetched_s(network({mirror(1e4), mirror(1e9, 0)}), 0, 200'000), 20.02, 1e-6);
}

/// Answers by a script; time passes only in wait().
class Script final : public Transport {
 public:
  using Answer =
      std::function<std::optional<Outcome>(const TransferRequest&, std::uint32_t mirror, int try_)>;
  Script(std::size_t mirrors, Answer answer) : mirrors_(mirrors), answer_(std::move(answer)) {}
  std::size_t mirrors() const override { return mirrors_; }
  double now_s() override { return now_s_; }
  void start(const TransferRequest& request, std::uint32_t mirror) override {
    started.push_back({request.number, mirror, now_s_});
    if (auto outcome = answer_(request, mirror, tries_[request.number]++)) {
      outcome->number = request.number;
      outcome->time_s += now_s_;
      coming_.push_back(*outcome);
    } else {
      silent_.insert(request.number);
    }
  }
  void cancel(std::uint32_t number) override {
    silent_.erase(number);
    std::erase_if(coming_, [&](const Outcome& o) { return o.number == number; });
  }
  std::optional<Outcome> wait(double until_s) override {
    const auto it = std::ranges::min_element(coming_, {}, &Outcome::time_s);
    if (it != coming_.end() && it->time_s <= until_s) {
      Outcome o = *it;
      coming_.erase(it);
      now_s_ = std::max(now_s_, o.time_s);
      return o;
    }
    if (until_s < kForEver_s) now_s_ = std::max(now_s_, until_s);
    return std::nullopt;
  }
  struct Started {
    std::uint32_t number = 0, mirror = 0;
    double at_s = 0;
  };
  std::vector<Started> started;

 private:
  std::size_t mirrors_;
  Answer answer_;
  double now_s_ = 0;
  std::map<std::uint32_t, int> tries_;
  std::vector<Outcome> coming_;
  std::set<std::uint32_t> silent_;
};
Transport::Outcome after(double s, bool good, double wait_s = 0, bool for_good = false) {
  return {0, s, good, {}, good ? "" : "status 503", wait_s, for_good};
}

/// So many requests, all at once.
class Requests final : public RequestSource {
 public:
  explicit Requests(std::uint32_t count) : count_(count) {}
  std::optional<TransferRequest> next(double) override {
    if (next_ == count_) return std::nullopt;
    return TransferRequest{next_++, 1000, {}};
  }
  bool arrived(const Transport::Outcome& o) override {
    if (refuse) return false;
    got.insert(o.number);
    return true;
  }
  void failed(std::uint32_t number, double) override { lost.insert(number); }
  bool finished() const override { return got.size() + lost.size() == count_; }
  std::set<std::uint32_t> got, lost;
  bool refuse = false;

 private:
  std::uint32_t count_, next_ = 0;
};

TEST(Transfer, SilentMirrorsAreAskedSoManyTimesAndNoMore) {
  Script silent(2, [](auto&&...) { return std::nullopt; });
  Requests requests(10);
  const TransferEnd end = transfer(requests, silent, {});
  EXPECT_EQ(requests.lost.size(), 10u);
  EXPECT_EQ(end.given_up, 10u);
  EXPECT_EQ(silent.started.size(), 30u);
  EXPECT_EQ(end.problems.at("no answer in time"), 30u);
  EXPECT_LT(silent.now_s(), 60);
}

TEST(Transfer, ASilentServerIsLeftWhenTheTimeIsOver) {
  Script silent(1, [](auto&&...) { return std::nullopt; });
  Requests requests(10);
  TransferOptions o;
  o.until_s = 2;
  const TransferEnd end = transfer(requests, silent, o);
  EXPECT_TRUE(end.out_of_time);
  EXPECT_FALSE(end.cancelled);
  EXPECT_EQ(end.unfinished, 10u);
  EXPECT_EQ(requests.lost.size(), 10u);
  EXPECT_NEAR(silent.now_s(), 2, 0.01);
  Script dead(1, [](auto&&...) { return std::nullopt; });
  Requests others(10);
  const TransferEnd never = transfer(others, dead, {});
  EXPECT_TRUE(never.dead);
  EXPECT_EQ(others.lost.size(), 10u);
}

TEST(Transfer, AServerThatIsBusyIsAskedAgainAfterTheTimeItNames) {
  Script busy(1, [](auto&&, std::uint32_t, int again) { return after(0.01, again > 0, 1.5); });
  Requests requests(2);
  const TransferEnd end = transfer(requests, busy, {});
  EXPECT_EQ(requests.got.size(), 2u);
  ASSERT_EQ(busy.started.size(), 4u);
  EXPECT_NEAR(busy.started[2].at_s, 1.51, 1e-6);
  EXPECT_EQ(end.problems.at("status 503"), 2u);
  Script long_wait(1, [](auto&&, std::uint32_t, int again) { return after(0.01, again > 0, 3600); });
  Requests one(1);
  transfer(one, long_wait, {});
  EXPECT_LT(long_wait.now_s(), 6);  // not for an hour
}

TEST(Transfer, PausesGrow) {
  Script failing(1, [](auto&&...) { return after(0, false, 0.01); });
  Requests requests(1);
  TransferOptions o;
  o.tries = 5;
  EXPECT_EQ(transfer(requests, failing, o).given_up, 1u);
  ASSERT_EQ(failing.started.size(), 5u);
  for (std::size_t i = 2; i < 5; ++i)
    EXPECT_NEAR(failing.started[i].at_s - failing.started[i - 1].at_s,
                2 * (failing.started[i - 1].at_s - failing.started[i - 2].at_s), 1e-9);
}

TEST(Transfer, AMirrorThatFailedComesBackWhenTheOthersFail) {
  // The first fails once, the second from its second request on.
  int first = 0, second = 0;
  Script both(2,
              [&](auto&&, std::uint32_t m, int) { return after(0.01, m == 0 ? first++ > 0 : second++ < 1); });
  class OneByOne final : public RequestSource {
   public:
    std::optional<TransferRequest> next(double) override {
      if (asked_ > done_ || done_ == 6) return std::nullopt;
      return TransferRequest{asked_++, 1000, {}};
    }
    bool arrived(const Transport::Outcome&) override { return ++done_, ++got, true; }
    void failed(std::uint32_t, double) override { ++done_; }
    bool finished() const override { return done_ == 6; }
    int got = 0;

   private:
    std::uint32_t asked_ = 0, done_ = 0;
  } requests;
  transfer(requests, both, {});
  EXPECT_EQ(requests.got, 6);
}

TEST(Transfer, WhatIsGoneForGoodIsNotAskedAgain) {
  Script gone(2, [](auto&&...) { return after(0.01, false, 0, true); });
  Requests requests(5);
  const TransferEnd end = transfer(requests, gone, {});
  EXPECT_EQ(end.given_up, 5u);
  EXPECT_LE(gone.started.size(), 10u);
  std::set<std::uint32_t> late;
  for (const auto& s : gone.started)
    if (s.at_s > 0.2) late.insert(s.number);
  EXPECT_TRUE(late.empty());
}

TEST(Transfer, WrongBytesAreNamed) {
  Script well(1, [](auto&&...) { return after(0.01, true); });
  Requests requests(1);
  requests.refuse = true;
  const TransferEnd end = transfer(requests, well, {});
  EXPECT_EQ(end.given_up, 1u);
  EXPECT_EQ(end.problems.at("bytes of another digest"), 3u);
}

TEST(Transfer, ALiarIsDroppedAndWhatItOwesIsDealtAnew) {
  std::vector<MirrorModel> mirrors{mirror(1e5), mirror(1e5), mirror(2e5)};
  mirrors[1].lies_from_s = 1;
  HtcOptions o = options();
  o.sites = 3;
  o.initial_bytes_s = 4e5;
  const SimulationResult r = simulate(testing::photo_offers(), o, network(mirrors));
  EXPECT_EQ(r.given_up, 0u);
  EXPECT_LT(r.late_s, 0.3);
  ASSERT_EQ(r.mirrors.size(), 3u);
  EXPECT_GT(r.mirrors[1].requests, 0u);  // before it began to lie
  EXPECT_EQ(r.mirrors[1].dropped, "bytes of another digest");
  EXPECT_LT(r.mirrors[1].bytes, 1.2e5);
  EXPECT_EQ(r.mirrors[0].dropped + r.mirrors[2].dropped, "");
  std::uint64_t bytes = 0;
  for (const MirrorShare& m : r.mirrors) bytes += m.bytes;
  EXPECT_EQ(bytes, r.bytes);
}

TEST(Transfer, ALiarAloneIsAskedUntilItsTriesAreOver) {
  MirrorModel liar = mirror(1e6);
  liar.lies_from_s = 0;
  const SimulationResult r = simulate(testing::photo_offers(), options(), network({liar}));
  EXPECT_TRUE(r.never);
  EXPECT_EQ(r.bytes, 0u);
}

TEST(Transfer, FragmentsAreDealtToSitesByTheirSpeed) {
  HtcOptions o = options();
  o.sites = 3;
  const SimulationResult r =
      simulate(testing::photo_offers(), o, network({mirror(1e5), mirror(2e5), mirror(4e5)}));
  ASSERT_EQ(r.mirrors.size(), 3u);
  const double all = static_cast<double>(r.bytes);
  EXPECT_NEAR(static_cast<double>(r.mirrors[0].bytes) / all, 1.0 / 7, 0.06);
  EXPECT_NEAR(static_cast<double>(r.mirrors[1].bytes) / all, 2.0 / 7, 0.06);
  EXPECT_NEAR(static_cast<double>(r.mirrors[2].bytes) / all, 4.0 / 7, 0.08);
  // Together they are nearly as fast as one that has all their throughput.
  const SimulationResult one = simulate(testing::photo_offers(), options(), network({mirror(7e5)}));
  EXPECT_LT(r.end_s, 1.15 * one.end_s);
}

/// One request after the other, each of another entry.
class Entries final : public RequestSource {
 public:
  explicit Entries(std::uint32_t count) : count_(count) {}
  std::optional<TransferRequest> next(double) override {
    if (at_ > done_ || at_ == count_) return std::nullopt;
    const EntryRef entry{"entry", 1000ull * (at_ / 2), 1000, {}};  // two requests an entry
    return TransferRequest{at_++, 100, {{entry, {0, 100}}}};
  }
  bool arrived(const Transport::Outcome&) override { return ++done_, true; }
  void failed(std::uint32_t, double) override { ++done_, ++lost; }
  bool finished() const override { return done_ == count_; }
  std::uint32_t lost = 0;

 private:
  std::uint32_t count_, at_ = 0, done_ = 0;
};

TEST(Transfer, AMirrorThatLacksAnEntryIsNotAskedForItAgain) {
  // Mirror 0 has the entries of requests 0 .. 3, mirror 1 those from 2 on; nobody has the last one.
  Script script(2, [](const TransferRequest& r, std::uint32_t mirror, int) {
    Transport::Outcome o{r.number, 0.01, true, {}, {}, 0, false};
    const bool has = r.number < 8 && (mirror == 0 ? r.number < 4 : r.number >= 2);
    o.good = has;
    o.absent = !has;
    if (!has) o.problem = "status 404";
    return std::optional(o);
  });
  Entries source(10);
  const TransferEnd end = transfer(source, script, {});
  EXPECT_EQ(source.lost, 2u);
  EXPECT_EQ(end.given_up, 2u);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> asked;  // by mirror and entry
  for (const Script::Started& s : script.started) ++asked[{s.mirror, s.number / 2}];
  for (const auto& [key, count] : asked) {
    const auto [mirror, entry] = key;
    const bool has = entry < 4 && (mirror == 0 ? entry < 2 : entry >= 1);
    EXPECT_LE(count, has ? 2 : 1) << mirror << ' ' << entry;
  }
  for (const MirrorShare& m : end.mirrors) EXPECT_EQ(m.dropped, "");
}

}  // namespace texmesh::transfer_test
