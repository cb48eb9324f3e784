// Fragments over real sockets: within a limit, from several mirrors of which some are bad, cancelled,
// refined, for another display, from a server without ranges. No times are tested, only what was asked for
// and what arrived.
#include "delivery/cpp/client/texture_loader.h"

#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <mutex>
#include <set>

#include "delivery/cpp/package/http_store.h"
#include "delivery/cpp/transfer/transfer.h"
#include "format/base/errors.h"
#include "tests/delivery/package/raw_server.h"
#include "tests/format/container/package_fixture.h"

namespace texmesh::texture_loader_test {

using namespace testing;  // NOLINT: server and package of the tests

constexpr std::uint32_t kPlanes = 6;  // of two fragments at two rungs each

const std::string& package_bytes() {
  static const std::string bytes = text_of(make_package(kPlanes, 70'000));  // nothing is in the first range
  return bytes;
}
Reply good(const Request& r) { return {ranged(package_bytes(), r)}; }

/// Counts what arrives, and fails when something comes twice.
struct Shown {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::int32_t> rung;
  void operator()(const LoadedFragment& f) {
    const auto key = std::pair(f.plane, f.fragment);
    EXPECT_TRUE(!rung.contains(key) || rung[key] < f.rung);
    EXPECT_FALSE(f.streams.empty());
    rung[key] = f.rung;
  }
};

/// Asks for the planned sizes, whatever happens: does not depend on how fast this machine is.
struct PlannedSizes final : TransferPolicy {
  double target_bytes(const HarmonicTimePlan& plan, std::uint32_t offer, double, double) const override {
    return plan.planned_bytes(offer);
  }
  bool skips_early() const override { return true; }
};

struct Client {
  explicit Client(const std::vector<std::string>& mirrors, bool whole_rungs = false)
      : package(open_url(mirrors[0], quick())),
        transport(open_transport(mirrors, {quick(), 4, {}})),
        loader(package, *transport, whole_rungs) {}
  LoadOptions options(double bytes_s = 1e6) {
    LoadOptions o;
    o.htc.other_policy = [] { return std::make_unique<PlannedSizes>(); };
    o.htc.time_limit_s = 1;
    o.htc.window = 4;
    o.htc.initial_bytes_s = bytes_s;
    o.htc.hard_limits = true;
    o.grace_s = 60;  // nor here
    o.on_fragment = [this](const LoadedFragment& f) { shown(f); };
    return o;
  }
  /// The upper rung where it loses less; the tables of this package are random.
  void expect_refined() {
    for (std::uint32_t p = 0; p < kPlanes; ++p)
      for (std::uint32_t f = 0; f < 2; ++f) {
        const std::vector<float>& dssim = package.tables().planes[p].dssim;
        EXPECT_EQ(loader.held(p, f), dssim[2 + f] < dssim[f]) << p << " " << f;
      }
  }
  PackageReader package;
  std::unique_ptr<Transport> transport;
  TextureLoader loader;
  Shown shown;
};

TEST(TextureLoader, FetchesEveryFragmentOnceAndTellsWhatItHolds) {
  RawServer server(good);
  Client c({server.url("/a.texmesh")});
  const LoadReport r = c.loader.load(full_size(c.package), c.options());
  EXPECT_EQ(c.shown.rung.size(), 2 * kPlanes);
  EXPECT_EQ(r.given_up, 0u);
  EXPECT_FALSE(r.cancelled);
  EXPECT_EQ(r.transfer.bytes, c.loader.bytes());
  for (const auto& [where, rung] : c.shown.rung) EXPECT_EQ(c.loader.held(where.first, where.second), rung);
  std::set<std::uint64_t> begins;
  for (const Request& q : server.requests()) EXPECT_TRUE(begins.insert(q.first).second) << q.first;
}

TEST(TextureLoader, AServerMaySendLessThanIsAskedFor) {
  int cut = 0;
  RawServer server([&](Request r) {
    if (r.first > 0 && r.last > r.first + 1023 && ++cut > 0) r.last = r.first + 1023;
    return Reply{ranged(package_bytes(), r)};
  });
  Client c({server.url("/a.texmesh")});
  EXPECT_EQ(c.loader.load(full_size(c.package), c.options()).given_up, 0u);
  EXPECT_EQ(c.shown.rung.size(), 2 * kPlanes);
  EXPECT_GT(cut, 0);
}

TEST(TextureLoader, RefinesToTheTopWithinItsBytes) {
  RawServer server(good);
  Client c({server.url("/a.texmesh")});
  LoadOptions o = c.options();
  o.list.quality_high = 1;  // the lowest rung only
  c.loader.load(full_size(c.package), o);
  for (const auto& [where, rung] : c.shown.rung) EXPECT_EQ(rung, 0);
  const std::uint64_t before = c.loader.bytes();
  EXPECT_EQ(c.loader.refine(full_size(c.package), o, {60, 0}).transfer.bytes, 0u);
  const PlaneTables& t = c.package.tables().planes[0];
  const std::uint64_t one = std::max(t.size_bytes[2], t.size_bytes[3]);
  const LoadReport some = c.loader.refine(full_size(c.package), o, {60, one});
  EXPECT_LE(some.transfer.bytes, one);
  EXPECT_GT(some.transfer.bytes, 0u);
  const LoadReport all = c.loader.refine(full_size(c.package), o, {});
  EXPECT_EQ(c.loader.bytes(), before + some.transfer.bytes + all.transfer.bytes);
  c.expect_refined();
  EXPECT_EQ(all.given_up, 0u);
  const std::size_t requests = server.requests().size();
  EXPECT_EQ(c.loader.refine(full_size(c.package), o, {}).transfer.bytes, 0u);  // nothing is left
  EXPECT_EQ(server.requests().size(), requests);
}

TEST(TextureLoader, BadMirrorsAreReplacedByAGoodOne) {
  RawServer well(good);
  RawServer failing([](const Request&) { return Reply{answer(500, "", "no")}; });
  RawServer lying([](const Request& r) {
    std::string reply = ranged(package_bytes(), r);
    reply[reply.size() - 1] ^= 1;
    return Reply{reply};
  });
  RawServer cutting([](const Request& r) {
    std::string reply = ranged(package_bytes(), r);
    return Reply{reply.substr(0, reply.size() - 1), true};
  });
  RawServer unranged([](const Request&) { return Reply{answer(200, "", package_bytes())}; });
  for (RawServer* bad : {&failing, &lying, &cutting, &unranged}) {
    Client c({well.url("/a.texmesh"), bad->url("/a.texmesh")});
    const LoadReport r = c.loader.load(full_size(c.package), c.options());
    EXPECT_EQ(r.given_up, 0u);
    EXPECT_EQ(c.shown.rung.size(), 2 * kPlanes);
    EXPECT_FALSE(bad->requests().empty());
    EXPECT_LT(bad->requests().size(), 6u);  // it is left alone soon
  }
}

TEST(TextureLoader, AMirrorThatSaysNothingIsAskedElsewhere) {
  RawServer well(good);
  RawServer silent([](const Request&) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    return Reply{"", true};
  });
  Client c({well.url("/a.texmesh"), silent.url("/a.texmesh")});
  EXPECT_EQ(c.loader.load(full_size(c.package), c.options()).given_up, 0u);
  EXPECT_EQ(c.shown.rung.size(), 2 * kPlanes);
}

TEST(TextureLoader, WhatNobodyDeliversIsGivenUpAndTheRestArrives) {
  std::uint64_t broken = 0;
  RawServer server([&](const Request& r) {
    return broken && r.first == broken ? Reply{answer(404, "", "gone")} : good(r);
  });
  Client c({server.url("/a.texmesh")});
  LoadOptions o = c.options();
  o.list.quality_high = 1;
  broken = c.package.textures()[2].rungs[0].offset + c.package.fragment_range(2, 0, 1).offset;
  const LoadReport r = c.loader.load(full_size(c.package), o);
  EXPECT_EQ(r.given_up, 1u);
  EXPECT_EQ(c.shown.rung.size(), 2 * kPlanes - 1);
  EXPECT_EQ(c.loader.held(2, 1), -1);
  std::size_t tries = 0;
  for (const Request& q : server.requests()) tries += q.first == broken;
  EXPECT_EQ(tries, 3u);
  broken = 0;
  EXPECT_EQ(c.loader.load(full_size(c.package), o).given_up, 0u);  // a later load tries again
  EXPECT_EQ(c.loader.held(2, 1), 0);
}

TEST(TextureLoader, CancelKeepsWhatHasArrivedAndNothingIsFetchedAgain) {
  RawServer server(good);
  Client c({server.url("/a.texmesh")});
  LoadOptions o = c.options();
  o.list.quality_high = 1;
  o.htc.window = 1;
  o.cancelled = [&] { return c.shown.rung.size() >= 3; };
  EXPECT_TRUE(c.loader.load(full_size(c.package), o).cancelled);
  EXPECT_EQ(c.shown.rung.size(), 3u);
  o.cancelled = {};
  c.loader.load(full_size(c.package), o);
  EXPECT_EQ(c.shown.rung.size(), 2 * kPlanes);
  std::uint64_t sum = 0;
  for (std::uint32_t p = 0; p < kPlanes; ++p)
    for (std::uint32_t f = 0; f < 2; ++f) sum += c.package.tables().planes[p].size_bytes[f];
  EXPECT_GE(c.loader.bytes(), sum);
}

TEST(TextureLoader, AnotherDisplayFetchesOnlyWhatItLacks) {
  RawServer server(good);
  Client c({server.url("/a.texmesh")});
  std::vector<PlaneChoice> some = full_size(c.package);
  some.resize(2);
  c.loader.load(some, c.options());
  EXPECT_EQ(c.shown.rung.size(), 4u);
  const std::size_t requests = server.requests().size();
  LoadOptions o = c.options();
  o.list.quality_high = 1;  // nothing better for the two planes that are there
  c.loader.load(full_size(c.package), o);
  EXPECT_EQ(c.shown.rung.size(), 2 * kPlanes);
  EXPECT_GE(server.requests().size(), requests + 2 * (kPlanes - 2));
}

TEST(TextureLoader, WithoutRangesWholeRungsAreTaken) {
  std::map<std::string, std::string> files;
  const auto source = memory_source(
      std::span(reinterpret_cast<const std::uint8_t*>(package_bytes().data()), package_bytes().size()));
  for (const ContainerEntry& e : read_container(*source))
    files["/a/" + e.path] = text_of(source->read(e.offset, e.bytes));
  RawServer server([&](const Request& r) {
    const auto it = files.find(r.path);
    return Reply{it == files.end() ? answer(404, "", "no") : answer(200, "", it->second)};
  });
  Client c({server.url("/a/")}, true);
  const LoadReport r = c.loader.load(full_size(c.package), c.options());
  EXPECT_EQ(r.transfer.rungs.size(), kPlanes);
  EXPECT_EQ(c.shown.rung.size(), 2 * kPlanes);
  EXPECT_EQ(r.given_up, 0u);
  c.loader.refine(full_size(c.package), c.options(), {});
  EXPECT_EQ(c.loader.refine(full_size(c.package), c.options(), {}).transfer.bytes, 0u);
}

TEST(TextureLoader, NeighboursAreAskedForTogether) {
  RawServer server(good);
  Client c({server.url("/a.texmesh")});
  c.package.tables();
  const std::size_t requests = server.requests().size();
  LoadOptions o = c.options();
  o.group_bytes = 1e9;
  o.list.quality_high = 1;
  const LoadReport r = c.loader.load(full_size(c.package), o);
  EXPECT_EQ(server.requests().size() - requests, kPlanes);  // both fragments of a plane
  EXPECT_EQ(r.transfer.steps.size(), kPlanes);
  EXPECT_EQ(r.fragments, 2 * kPlanes);
  EXPECT_EQ(c.shown.rung.size(), 2 * kPlanes);
  EXPECT_EQ(r.given_up, 0u);
  c.loader.refine(full_size(c.package), c.options(), {});
  c.expect_refined();
}

TEST(TextureLoader, OfAGroupOnlyWhatIsWrongIsLost) {
  std::uint64_t broken = 0;
  RawServer server([&](const Request& r) {
    std::string reply = ranged(package_bytes(), r);
    if (broken && r.first <= broken && broken <= r.last)
      reply[reply.size() - static_cast<std::size_t>(r.last - broken) - 1] ^= 1;
    return Reply{reply};
  });
  Client c({server.url("/a.texmesh")});
  LoadOptions o = c.options();
  o.list.quality_high = 1;
  o.group_bytes = 1e9;
  broken = c.package.textures()[2].rungs[0].offset + c.package.fragment_range(2, 0, 1).offset;
  const LoadReport r = c.loader.load(full_size(c.package), o);
  EXPECT_EQ(r.given_up, 1u);
  EXPECT_EQ(r.problems.at("bytes of another digest"), 3u);
  EXPECT_EQ(c.shown.rung.size(), 2 * kPlanes - 1);
  EXPECT_EQ(c.loader.held(2, 0), 0);
  EXPECT_EQ(c.loader.held(2, 1), -1);
}

TEST(TextureLoader, CutAnswersAreResumedWhereTheyBroke) {
  std::atomic<bool> cut{false};
  std::mutex mutex;
  std::map<std::uint64_t, int> seen;
  RawServer server([&](const Request& r) {
    std::string reply = ranged(package_bytes(), r);
    const std::lock_guard lock(mutex);
    if (cut && seen[r.last]++ == 0) return Reply{reply.substr(0, reply.size() - 5), true};
    return Reply{reply};
  });
  Client c({server.url("/a.texmesh")});
  c.package.tables();
  cut = true;
  const std::size_t before = server.requests().size();
  const LoadReport r = c.loader.load(full_size(c.package), c.options());
  EXPECT_EQ(r.given_up, 0u);
  EXPECT_EQ(c.shown.rung.size(), 2 * kPlanes);
  EXPECT_EQ(r.problems.at("the answer was cut off"), 2 * kPlanes);
  std::map<std::uint64_t, std::vector<std::uint64_t>> begins;
  for (std::size_t i = before; i < server.requests().size(); ++i)
    begins[server.requests()[i].last].push_back(server.requests()[i].first);
  for (const auto& [last, first] : begins) {
    ASSERT_EQ(first.size(), 2u);
    EXPECT_EQ(first[1], last - 4);  // the five bytes that were missing
  }
}

TEST(TextureLoader, APackageThatWasReplacedIsSaidToBe) {
  for (const bool whole : {true, false}) {
    std::atomic<bool> replaced{false};
    RawServer server([&](const Request& r) {
      const std::string etag = replaced ? "\"two\"" : "\"one\"";
      if (whole && replaced) return Reply{answer(200, "ETag: " + etag + "\r\n", "new")};
      std::string bytes = package_bytes();
      if (replaced)
        for (char& c : bytes) c ^= 1;
      return Reply{ranged(bytes, r, "ETag: " + etag + "\r\n")};
    });
    const std::string url = server.url("/a.texmesh");
    PackageReader package(open_url(url, quick()));
    package.tables();
    const auto transport = open_transport({url}, {quick(), 4, {{url, "\"one\""}}});
    TextureLoader loader(package, *transport);
    replaced = true;
    LoadOptions o;
    o.grace_s = 60;
    const LoadReport r = loader.load(full_size(package), o);
    EXPECT_GT(r.given_up, 0u);
    bool said = false;
    for (const auto& [why, count] : r.problems)
      said = said || why.find(whole ? "replaced" : "another digest") != std::string::npos;
    EXPECT_TRUE(said);
    EXPECT_LT(server.requests().size(), whole ? 12u : 48u);  // an ETag alone proves nothing
  }
}

TEST(TextureLoader, WhyFragmentsAreGivenUpIsSaid) {
  const auto problem_of = [](const std::function<Reply(const Request&)>& bad) {
    std::atomic<bool> opened{false};
    RawServer server([&](const Request& r) { return opened ? bad(r) : good(r); });
    Client c({server.url("/a.texmesh")});
    c.package.tables();
    opened = true;
    LoadOptions o = c.options();
    o.tries = 1;
    const LoadReport r = c.loader.load(full_size(c.package), o);
    EXPECT_EQ(r.given_up, 2 * kPlanes);
    std::string all;
    for (const auto& [why, count] : r.problems) all += why + ";";
    return all;
  };
  EXPECT_NE(problem_of([](auto&&) { return Reply{answer(404, "", "")}; }).find("status 404"),
            std::string::npos);
  EXPECT_NE(problem_of([](auto&&) { return Reply{answer(200, "", package_bytes())}; }).find("no ranges"),
            std::string::npos);
  EXPECT_NE(problem_of([](auto&&) { return Reply{}; }).find("timeout"), std::string::npos);
}

TEST(TextureLoader, ASilentServerEndsTheLoadWithItsTime) {
  std::atomic<bool> opened{false};
  RawServer server([&](const Request& r) { return opened ? Reply{} : good(r); });
  Client c({server.url("/a.texmesh")});
  c.package.tables();
  opened = true;
  HttpOptions patient = quick();
  patient.stall_timeout_s = 60;
  const auto transport = open_transport({server.url("/a.texmesh")}, {patient, 4, {}});
  TextureLoader loader(c.package, *transport);
  LoadOptions o = c.options();
  o.htc.time_limit_s = 0.2;
  o.grace_s = 0.2;
  const LoadReport r = loader.load(full_size(c.package), o);
  EXPECT_TRUE(r.out_of_time);
  EXPECT_FALSE(r.cancelled);
  EXPECT_GT(r.given_up, 0u);
  EXPECT_EQ(r.given_up + r.skipped, 2 * kPlanes);
  EXPECT_EQ(r.transfer.bytes, 0u);
}

TEST(TextureLoader, WhatIsHereNeedsNoNetwork) {
  PackageReader package(open_container(memory_source(
      std::span(reinterpret_cast<const std::uint8_t*>(package_bytes().data()), package_bytes().size()))));
  const auto transport = open_transport(package.store());
  TextureLoader loader(package, *transport);
  EXPECT_EQ(loader.load(full_size(package), {}).given_up, 0u);
  EXPECT_GE(loader.held(0, 0), 0);
}

TEST(TextureLoader, MirrorsMustBeUrls) {
  EXPECT_THROW(open_transport(std::vector<std::string>{}), InputError);
  EXPECT_THROW(open_transport(std::vector<std::string>{"/tmp/a.texmesh"}), InputError);
}

}  // namespace texmesh::texture_loader_test
