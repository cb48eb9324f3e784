// A cache server that goes wrong at each of its answers in turn: what stores then find is what was put, or
// nothing, and a server that is sound again is made good.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <map>
#include <mutex>
#include <thread>

#include "pipeline/cache/cache_layer.h"
#include "pipeline/cache/disk_store.h"
#include "tests/pipeline/cache/cache_fixtures.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::http_layer_faults_test {

enum class Fault {
  kDies,      // and everybody who asks from then on is hung up on
  kHangsUp,   // without a word
  kIsSilent,  // until the other side gives up
  kStopsInTheMiddle,
  kIsBusy,
  kTalksNonsense,
  kFlipsABit,     // of the body, which is as long as it says
  kIsEmpty,       // and says that all is well
  kLosesAHalf,    // as kIsEmpty, of what it was given as well as of what it gives
  kSendsForever,  // a body longer than anybody asked for
};
constexpr int kFaults = 10;

struct Request {
  std::string method, path, body;
};

/// GET, HEAD and PUT over one connection after the other.
class FaultyServer {
 public:
  FaultyServer() : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(fd_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(fd_, 16), 0);
    EXPECT_EQ(::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    url_ = "http://127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    thread_ = std::thread([this] { accept_all(); });
  }
  /// All clients are gone.
  ~FaultyServer() {
    ::shutdown(fd_, SHUT_RDWR);
    thread_.join();
    ::close(fd_);
  }
  FaultyServer(const FaultyServer&) = delete;
  FaultyServer& operator=(const FaultyServer&) = delete;

  const std::string& url() const { return url_; }
  int answers() const { return answers_; }
  /// As it was when it was new; nobody is connected.
  void forget() {
    const std::lock_guard lock(mutex_);
    objects_.clear();
  }
  /// The answer number `at`, from 1, counted from now on; 0 = none of them.
  void plan(Fault fault, int at) {
    fault_ = fault;
    answers_ = 0;
    at_ = at == 0 ? 1 << 30 : at;
  }

 private:
  void accept_all() {
    for (;;) {
      const int connection = ::accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC);
      if (connection < 0) return;
      if (fault_ != Fault::kDies || answers_ < at_) serve(connection);
      ::close(connection);
    }
  }

  void serve(int connection) {
    std::string bytes;
    Request request;
    while (read_request(connection, bytes, request)) {
      const bool wrong = ++answers_ == at_;
      if (wrong && (fault_ == Fault::kDies || fault_ == Fault::kHangsUp)) return;
      if (wrong && fault_ == Fault::kIsSilent) {
        while (receive(connection, bytes)) continue;
        return;
      }
      const std::string answer = answer_to(request, wrong);
      const bool ends = wrong && (fault_ == Fault::kStopsInTheMiddle || fault_ == Fault::kTalksNonsense);
      for (std::size_t at = 0, end = answer.size() / (wrong && fault_ == Fault::kStopsInTheMiddle ? 2 : 1);
           at < end;) {
        const ssize_t sent = ::send(connection, answer.data() + at, end - at, MSG_NOSIGNAL);
        if (sent <= 0) return;
        at += static_cast<std::size_t>(sent);
      }
      if (ends) return;
    }
  }

  static bool receive(int connection, std::string& bytes) {
    char buffer[4096];
    const ssize_t n = ::recv(connection, buffer, sizeof buffer, 0);
    if (n > 0) bytes.append(buffer, static_cast<std::size_t>(n));
    return n > 0;
  }

  static bool read_request(int connection, std::string& bytes, Request& request) {
    std::size_t end = 0;
    while ((end = bytes.find("\r\n\r\n")) == std::string::npos)
      if (!receive(connection, bytes)) return false;
    const std::string head = bytes.substr(0, end + 2);
    const std::size_t blank = head.find(' ');
    request.method = head.substr(0, blank);
    request.path = head.substr(blank + 1, head.find(' ', blank + 1) - blank - 1);
    constexpr std::string_view kLength = "Content-Length: ";
    const std::size_t length_at = head.find(kLength);
    const std::size_t length =
        length_at == std::string::npos ? 0 : std::stoul(head.substr(length_at + kLength.size()));
    EXPECT_EQ(head.find("Expect:"), std::string::npos) << "each PUT would wait a second for an answer to it";
    while (bytes.size() < end + 4 + length)
      if (!receive(connection, bytes)) return false;
    request.body = bytes.substr(end + 4, length);
    bytes.erase(0, end + 4 + length);
    return true;
  }

  std::string answer_to(const Request& request, bool wrong) {
    const std::lock_guard lock(mutex_);
    if (wrong && fault_ == Fault::kTalksNonsense) return "what?\r\n\r\n";
    if (wrong && fault_ == Fault::kIsBusy) return message(503, "", request.method);
    if (request.method == "PUT") {
      objects_[request.path] = wrong && fault_ == Fault::kLosesAHalf
                                   ? request.body.substr(0, request.body.size() / 2)
                                   : request.body;
      return message(201, "", request.method);
    }
    const auto it = objects_.find(request.path);
    if (it == objects_.end()) return message(404, "", request.method);
    std::string body = it->second;
    if (wrong && fault_ == Fault::kFlipsABit && !body.empty()) body[body.size() / 2] ^= 1;
    if (wrong && fault_ == Fault::kIsEmpty) body.clear();
    if (wrong && fault_ == Fault::kLosesAHalf) body.resize(body.size() / 2);
    if (wrong && fault_ == Fault::kSendsForever) body.resize(12u << 20);
    return message(200, body, request.method);
  }

  static std::string message(int status, const std::string& body, const std::string& method) {
    return "HTTP/1.1 " + std::to_string(status) + " X\r\nContent-Length: " + std::to_string(body.size()) +
           "\r\n\r\n" + (method == "HEAD" ? "" : body);
  }

  int fd_;
  std::string url_;
  std::mutex mutex_;
  std::map<std::string, std::string> objects_;
  std::atomic<Fault> fault_{Fault::kDies};
  std::atomic<int> at_{1 << 30}, answers_{0};
  std::thread thread_;
};

class ServerFaults : public ::testing::Test {
 protected:
  using Outputs = std::vector<std::pair<std::string, SharedBytes>>;

  std::unique_ptr<Store> store(const std::string& name, LayerUse use, double patience_s) const {
    std::vector<std::unique_ptr<CacheLayer>> layers;
    layers.push_back(open_http_layer(server_.url(), {patience_s, 900}));
    return layered_store(open_disk_store(folder_ / name), std::move(layers), use);
  }

  void put_all(Store& store) const {
    EXPECT_TRUE(store.put(key_, outputs_)) << "the local store is sound";
    EXPECT_TRUE(store.put_note(note_, "asked for a.png"));
  }

  /// How much of three was found; what was found is right.
  int found_in(Store& store) const {
    int found = 0;
    if (const auto blobs = store.find(key_.digest())) {
      EXPECT_EQ(blobs->size(), outputs_.size());
      ++found;
      bool all = true;
      for (std::size_t i = 0; i < blobs->size(); ++i) {
        EXPECT_EQ((*blobs)[i].name, outputs_[i].first);
        const SharedBytes bytes = store.load((*blobs)[i]);
        all = all && bytes;
        if (bytes) EXPECT_EQ(*bytes, *outputs_[i].second);
      }
      found += all ? 1 : 0;
    }
    if (const auto note = store.find_note(note_)) {
      EXPECT_EQ(*note, "asked for a.png");
      ++found;
    }
    return found;
  }

  /// One machine computes and uploads, another fetches.
  int work_of_two_machines(const std::string& name, double patience_s) const {
    put_all(*store(name + "-first", LayerUse::kUpload, patience_s));
    return found_in(*store(name + "-second", LayerUse::kFetch, patience_s));
  }

  TemporaryFolder folder_;
  const Key key_ = key_of("a");
  const Sha256 note_ = key_of("n").digest();
  const Outputs outputs_{{"x", bytes_of("a result")}, {"x.notes", bytes_of("")}, {"y", bytes_of("another")}};
  FaultyServer server_;
};

TEST_F(ServerFaults, AtEveryAnswerCostTimeAndNothingElse) {
  constexpr double kPatience_s = .3, kMuchPatience_s = 60;
  server_.plan(Fault::kDies, 0);
  EXPECT_EQ(work_of_two_machines("sound", kMuchPatience_s), 3);
  const int answers = server_.answers();
  ASSERT_GT(answers, 8);
  const int step = full_sweeps() ? 1 : 4;  // every store that is opened waits for the disk
  int points = 0, lost = 0;
  for (int fault = 0; fault < kFaults; ++fault)
    for (int at = 1 + fault % step; at <= answers; at += step) {
      SCOPED_TRACE("fault " + std::to_string(fault) + " in answer " + std::to_string(at));
      const std::string name = std::to_string(fault) + "-" + std::to_string(at);
      server_.forget();
      server_.plan(static_cast<Fault>(fault), at);
      const int found = work_of_two_machines(name, kPatience_s);
      ++points;
      lost += found < 3;
      server_.plan(Fault::kDies, 0);
      {
        const auto next = store(name + "-third", LayerUse::kUpload, kMuchPatience_s);
        if (found_in(*next) < 3) put_all(*next);
      }
      EXPECT_EQ(found_in(*store(name + "-fourth", LayerUse::kFetch, kMuchPatience_s)), 3)
          << "the server was not made good";
    }
  std::printf("%d answers of a cache server, %d points; in %d something was not found\n", answers, points,
              lost);
  EXPECT_GT(lost, points / 4) << "the faults are not at work";
  EXPECT_LT(lost, points) << "some faults, such as a bit of an answer without a body, cost nothing";
}

}  // namespace texmesh::testing::http_layer_faults_test
