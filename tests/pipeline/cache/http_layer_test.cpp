// The HTTP cache layer against a server of this test: what a plain server, a lying one and a dead one do.
#include <gtest/gtest.h>
#include <httplib.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <thread>

#include "pipeline/cache/cache_layer.h"
#include "pipeline/cache/disk_store.h"
#include "tests/support/command.h"

namespace texmesh::http_layer_test {

using testing::TemporaryFolder;

SharedBytes bytes_of(const std::string& s) {
  return std::make_shared<const std::vector<std::uint8_t>>(s.begin(), s.end());
}
Key key_of(const std::string& option) { return Key("ladder", 3).add("option ladder.rungs", option); }

/// GET and PUT of anything, as an nginx with DAV does it; bytes can be changed behind its back.
class Server {
 public:
  Server() {
    server_.Get(".*", [this](const httplib::Request& request, httplib::Response& response) {
      const std::lock_guard lock(mutex_);
      ++requests;
      if (status != 200) {
        response.status = status;
        return;
      }
      const auto it = objects.find(request.path);
      if (it == objects.end())
        response.status = 404;
      else
        response.set_content(it->second, "application/octet-stream");
    });
    server_.Put(".*", [this](const httplib::Request& request, httplib::Response& response) {
      const std::lock_guard lock(mutex_);
      ++puts;
      response.status = put_status;
      if (put_status == 201) objects[request.path] = request.body;
    });
    port_ = server_.bind_to_any_port("127.0.0.1");
    thread_ = std::thread([this] { server_.listen_after_bind(); });
    while (!server_.is_running()) std::this_thread::yield();
  }
  ~Server() {
    server_.stop();
    thread_.join();
  }
  std::string url() const { return "http://127.0.0.1:" + std::to_string(port_) + "/cache"; }

  std::map<std::string, std::string> objects;
  std::atomic<int> status{200}, put_status{201}, requests{0}, puts{0};  // HEAD counts among the requests

 private:
  httplib::Server server_;
  std::mutex mutex_;
  int port_ = 0;
  std::thread thread_;
};

std::unique_ptr<Store> store_with(const std::string& url, const std::string& folder, bool upload,
                                  const LayerClock& clock = {}) {
  std::vector<std::unique_ptr<CacheLayer>> layers;
  layers.push_back(open_http_layer(url, {}, clock));
  return layered_store(open_disk_store(folder), std::move(layers),
                       upload ? LayerUse::kUpload : LayerUse::kFetch, clock);
}

TEST(HttpLayer, WhatOneMachinePutsAnotherFinds) {
  Server server;
  const TemporaryFolder folder;
  {
    auto first = store_with(server.url(), folder / "first", true);
    ASSERT_TRUE(first->put(key_of("a"), {{"x", bytes_of("result")}, {"x.notes", bytes_of("")}}));
    ASSERT_TRUE(first->put_note(key_of("n").digest(), "note"));
    EXPECT_TRUE(first->take_events().empty());
  }
  EXPECT_EQ(server.objects.count("/cache/ac/" + to_hex(key_of("a").digest())), 1u);
  EXPECT_EQ(server.objects.count("/cache/cas/" + to_hex(sha256(*bytes_of("result")))), 1u);
  auto second = store_with(server.url() + "/", folder / "second", false);
  const auto found = second->find(key_of("a").digest());
  ASSERT_TRUE(found);
  EXPECT_EQ(*second->load(found->front()), *bytes_of("result"));
  EXPECT_EQ(second->find_note(key_of("n").digest()), "note");
  EXPECT_FALSE(second->find(key_of("b").digest()));
  EXPECT_TRUE(second->take_events().empty());  // a miss is nothing to speak of
  const auto before = server.objects.size();
  ASSERT_TRUE(second->put(key_of("b"), {{"x", bytes_of("mine")}}));
  EXPECT_EQ(server.objects.size(), before);  // uploads only when asked for
}

TEST(HttpLayer, NothingThatLiesIsBelieved) {
  Server server;
  const TemporaryFolder folder;
  store_with(server.url(), folder / "first", true)->put(key_of("a"), {{"x", bytes_of("result")}});
  const auto good = server.objects;
  int n = 0;
  const auto refused = [&](const std::string& what) {
    auto store = store_with(server.url(), folder / ("local" + std::to_string(n++)), false);
    EXPECT_FALSE(store->find(key_of("a").digest())) << what;
    server.objects = good;
  };
  for (auto& [path, body] : server.objects)
    body[body.size() / 2] = static_cast<char>(body[body.size() / 2] ^ 1);
  refused("flipped");
  for (auto& [path, body] : server.objects) body.resize(body.size() - 1);
  refused("shorter");
  for (auto& [path, body] : server.objects)
    if (path.find("/cas/") != std::string::npos) body += "more";
  refused("longer");
  server.objects["/cache/ac/" + to_hex(key_of("a").digest())] = std::string(5 << 20, 'x');
  refused("a record without end");
  EXPECT_TRUE(store_with(server.url(), folder / "sound", false)->find(key_of("a").digest()));
}

TEST(HttpLayer, AServerThatFailsIsLeftOutWithOneEvent) {
  Server server;
  const TemporaryFolder folder;
  auto store = store_with(server.url(), folder / "local", true);
  server.status = 500;
  EXPECT_FALSE(store->find(key_of("a").digest()));
  const int asked = server.requests;
  EXPECT_FALSE(store->find(key_of("b").digest()));
  EXPECT_EQ(server.requests, asked);
  EXPECT_TRUE(store->put(key_of("a"), {{"x", bytes_of("result")}}));
  const auto events = store->take_events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].code, "cache-layer-unreachable");
  EXPECT_NE(events[0].text.find("500"), std::string::npos);
  EXPECT_TRUE(store->find(key_of("a").digest()));
}

TEST(HttpLayer, ARefusedPutDoesNotEndGet) {
  Server server;
  const TemporaryFolder folder;
  store_with(server.url(), folder / "first", true)->put(key_of("there"), {{"x", bytes_of("result")}});
  for (const int refusal : {403, 405, 413, 507}) {
    server.put_status = refusal;
    server.puts = 0;
    auto store = store_with(server.url(), folder / ("local" + std::to_string(refusal)), true);
    EXPECT_TRUE(store->put(key_of("new"), {{"x", bytes_of("other")}}));
    EXPECT_TRUE(store->put(key_of("newer"), {{"x", bytes_of("another")}}));
    EXPECT_TRUE(store->find(key_of("there").digest())) << refusal;
    EXPECT_EQ(server.puts, 1) << "nothing more is offered to a server that refuses";
    const auto events = store->take_events();
    ASSERT_EQ(events.size(), 1u) << refusal;
    EXPECT_EQ(events[0].code, "cache-not-written");
    EXPECT_NE(events[0].text.find(std::to_string(refusal)), std::string::npos) << events[0].text;
    EXPECT_EQ(events[0].layer, -1) << "other models' processes go on asking";
  }
}

/// A clock that a test turns.
struct TurnedClock {
  std::chrono::steady_clock::time_point now = std::chrono::steady_clock::now();
  LayerClock clock() {
    return [this] { return now; };
  }
};

TEST(HttpLayer, AServerIsAskedAgainAfterAMinute) {
  Server server;
  const TemporaryFolder folder;
  store_with(server.url(), folder / "first", true)->put(key_of("there"), {{"x", bytes_of("result")}});
  TurnedClock time;
  auto store = store_with(server.url(), folder / "local", true, time.clock());
  server.status = 503;
  EXPECT_FALSE(store->find(key_of("there").digest()));
  server.status = 200;
  time.now += std::chrono::seconds(59);
  const int asked = server.requests;
  EXPECT_FALSE(store->find(key_of("there").digest()));
  EXPECT_EQ(server.requests, asked);
  time.now += std::chrono::seconds(1);
  EXPECT_TRUE(store->find(key_of("there").digest()));
  EXPECT_EQ(store->take_events().size(), 1u);
  // It fails again: told again, and left alone for another minute.
  server.status = 503;
  EXPECT_FALSE(store->find(key_of("b").digest()));
  EXPECT_FALSE(store->find(key_of("c").digest()));
  EXPECT_EQ(store->take_events().size(), 1u);
  // One that refused is offered results again, too.
  server.status = 200;
  server.put_status = 403;
  time.now += std::chrono::minutes(1);
  store->put(key_of("d"), {{"x", bytes_of("1")}});
  server.put_status = 201;
  server.puts = 0;
  store->put(key_of("e"), {{"x", bytes_of("2")}});
  EXPECT_EQ(server.puts, 0);
  time.now += std::chrono::minutes(1);
  store->put(key_of("f"), {{"x", bytes_of("3")}});
  EXPECT_EQ(server.puts, 2);  // blob and record
}

TEST(HttpLayer, WhatIsThereIsNotPutAgainUnlessItWasDamaged) {
  Server server;
  const TemporaryFolder folder;
  store_with(server.url(), folder / "first", true)->put(key_of("a"), {{"x", bytes_of("result")}});
  EXPECT_EQ(server.puts, 2);
  server.puts = 0;
  store_with(server.url(), folder / "second", true)->put(key_of("b"), {{"x", bytes_of("result")}});
  EXPECT_EQ(server.puts, 1);  // the record: another key gave the same bytes
  const auto blob = std::find_if(server.objects.begin(), server.objects.end(),
                                 [](const auto& o) { return o.first.find("/cas/") != std::string::npos; });
  ASSERT_NE(blob, server.objects.end());
  const std::string good = blob->second;
  for (const std::string& bad : {std::string("resulT"), std::string("res")}) {  // as long, and shorter
    blob->second = bad;
    auto store = store_with(server.url(), folder / ("local" + bad), true);
    EXPECT_FALSE(store->find(key_of("a").digest()));
    store->put(key_of("a"), {{"x", bytes_of("result")}});
    EXPECT_EQ(blob->second, good) << "healed by the machine that found it damaged";
  }
}

TEST(HttpLayer, NobodyThere) {
  std::string url;
  {
    const Server gone;
    url = gone.url();
  }
  const TemporaryFolder folder;
  auto store = store_with("http://user:secret@" + url.substr(7), folder / "local", true);
  EXPECT_FALSE(store->find(key_of("a").digest()));
  const auto events = store->take_events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].text.find("secret"), std::string::npos);
}

TEST(HttpLayer, AServerThatDripsIsLeftOut) {
  httplib::Server drips;
  std::atomic<int> requests{0};
  drips.Get(".*", [&](const httplib::Request&, httplib::Response& response) {
    ++requests;
    response.set_chunked_content_provider("text/plain", [](std::size_t, httplib::DataSink& sink) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      return sink.write("0123456789", 10);  // without end
    });
  });
  const int port = drips.bind_to_any_port("127.0.0.1");
  std::thread thread([&] { drips.listen_after_bind(); });
  while (!drips.is_running()) std::this_thread::yield();
  const std::string url = "http://127.0.0.1:" + std::to_string(port);
  const Sha256 digest = key_of("a").digest();
  for (const LayerPatience patience : {LayerPatience{0.3, 900}, LayerPatience{10, 0.3}}) {
    const auto layer = open_layer(url, patience);
    requests = 0;
    EXPECT_THROW(layer->get("cas", digest, 12'000'000'000), LayerError);
    EXPECT_THROW(layer->get("ac", digest, 1000), LayerError);
    EXPECT_EQ(requests, 1);  // it is not asked a second time
  }
  drips.stop();
  thread.join();
}

TEST(HttpLayer, AModelLosesAQuarterOfItsTimeToALayer) {
  EXPECT_EQ(patience_within(12).all_transfers_s, 3);
  EXPECT_EQ(patience_within(12).answer_s, 3);
  EXPECT_EQ(patience_within(3600).answer_s, 10);
  EXPECT_EQ(patience_within(0).answer_s, 10);
}

TEST(HttpLayer, OnlyHttp) {
  EXPECT_THROW(open_layer("file:///etc"), InputError);
  EXPECT_THROW(open_layer("ftp://host/cache"), InputError);
}

}  // namespace texmesh::http_layer_test
