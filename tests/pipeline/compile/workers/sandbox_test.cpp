// A child in the sandbox tries what it must not do. Each attempt runs in a process of its own, because a
// sandbox is for good.
#include "pipeline/compile/workers/sandbox.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <functional>
#include <map>
#include <thread>

#include "pipeline/io/atomic_file.h"
#include "tests/support/command.h"
#include "tests/support/sanitizers.h"

namespace texmesh::sandbox_test {
namespace fs = std::filesystem;

/// A server that listens on a port of its own; connecting to it needs no accept.
class Listener {
 public:
  Listener() : fd_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    EXPECT_EQ(::bind(fd_, reinterpret_cast<sockaddr*>(&address), length), 0);
    EXPECT_EQ(::listen(fd_, 4), 0);
    ::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &length);
    port_ = ntohs(address.sin_port);
  }
  ~Listener() { ::close(fd_); }
  std::uint16_t port() const { return port_; }

 private:
  int fd_;
  std::uint16_t port_ = 0;
};

int error_of(long result) { return result < 0 ? errno : 0; }

int try_to_read(const std::string& path) { return error_of(::open(path.c_str(), O_RDONLY)); }
int try_to_create(const std::string& path) {
  return error_of(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600));
}
int try_to_connect(std::uint16_t port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  if (fd < 0) return errno;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  return error_of(::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address));
}

class Sandbox : public ::testing::Test {
 protected:
  void SetUp() override {
    if (testing::kSanitized) GTEST_SKIP() << "sanitizers look into the process as a debugger does";
    if (!sandbox_support().complete())
      GTEST_SKIP() << "this kernel cannot bound a process: " << describe_sandbox(sandbox_support());
    for (const char* name : {"model", "result", "outside"}) fs::create_directories(folder_ / name);
    testing::write_text(folder_ / "model/skin.png", "skin");
    testing::write_text(folder_ / "outside/secret", "secret");
    rules_.read = {folder_ / "model"};
    rules_.write = {folder_ / "result"};
  }

  /// What `attempt` returns in a sandboxed child; -1 when the child died.
  int in_sandbox(const std::function<int()>& attempt) const {
    const pid_t child = ::fork();
    if (child == 0) {
      if (!enter_sandbox(rules_).complete()) ::_exit(250);
      ::_exit(attempt());
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  testing::TemporaryFolder folder_;
  SandboxRules rules_;
};

TEST_F(Sandbox, FilesOutsideAreNeitherReadNorWritten) {
  const std::string outside = folder_ / "outside/secret", model = folder_ / "model/skin.png";
  EXPECT_EQ(try_to_read(outside), 0) << "without a sandbox";
  EXPECT_EQ(in_sandbox([&] { return try_to_read(outside); }), EACCES);
  EXPECT_EQ(in_sandbox([&] { return try_to_read("/etc/passwd"); }), EACCES);
  EXPECT_EQ(in_sandbox([&] { return try_to_read(folder_.path().string()); }), EACCES);
  EXPECT_EQ(in_sandbox([&] { return try_to_create(folder_ / "outside/new"); }), EACCES);
  EXPECT_EQ(in_sandbox([&] { return error_of(::unlink(outside.c_str())); }), EACCES);
  EXPECT_EQ(in_sandbox([&] { return error_of(::truncate(outside.c_str(), 0)); }), EACCES);
  EXPECT_EQ(in_sandbox([&] { return try_to_read(model); }), 0);
  EXPECT_EQ(in_sandbox([&] { return try_to_create(folder_ / "model/new"); }), EACCES);
  EXPECT_EQ(in_sandbox([&] { return error_of(::truncate(model.c_str(), 0)); }), EACCES);
  // Through a link, and up from where files may be read.
  fs::create_symlink(outside, folder_ / "model/link");
  EXPECT_EQ(in_sandbox([&] { return try_to_read(folder_ / "model/link"); }), EACCES);
  EXPECT_EQ(in_sandbox([&] { return try_to_read(folder_ / "model/../outside/secret"); }), EACCES);
  EXPECT_EQ(testing::read_text(outside), "secret");
}

TEST_F(Sandbox, TheResultIsWrittenAndRenamed) {
  const std::string result = folder_ / "result/scan.texmesh";
  EXPECT_EQ(in_sandbox([&] {
              const std::uint8_t bytes[] = {1, 2, 3};
              write_file_atomically(result, bytes);
              write_file_atomically(result, bytes);
              fs::create_directories(folder_ / "result/ac/00");
              fs::rename(result, folder_ / "result/ac/00/moved");
              write_file_atomically(result, bytes);
              return 7;
            }),
            7);
  EXPECT_EQ(fs::file_size(result), 3u);
  const int stolen = in_sandbox([&] {
    std::error_code ec;
    fs::rename(result, folder_ / "outside/stolen", ec);
    return ec.value();
  });
  EXPECT_TRUE(stolen == EACCES || stolen == EXDEV) << stolen;
}

TEST_F(Sandbox, NothingIsConnectedTo) {
  const Listener listener;
  EXPECT_EQ(try_to_connect(listener.port()), 0) << "without a sandbox";
  EXPECT_EQ(in_sandbox([&] { return try_to_connect(listener.port()); }), EPERM);
  for (const int domain : {AF_UNIX, AF_INET6, AF_NETLINK, AF_PACKET})
    EXPECT_EQ(in_sandbox([&] { return error_of(::socket(domain, SOCK_DGRAM, 0)); }), EPERM) << domain;
}

TEST_F(Sandbox, WithCacheServersOnlyTheirPortsAreConnectedTo) {
  const Listener cache, other;
  rules_.network = true;
  rules_.ports = {cache.port()};
  EXPECT_EQ(in_sandbox([&] { return try_to_connect(cache.port()); }), 0);
  EXPECT_EQ(in_sandbox([&] { return error_of(::socket(AF_PACKET, SOCK_RAW, 0)); }), EPERM);
  EXPECT_EQ(in_sandbox([&] {
              const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
              return error_of(::listen(fd, 1));
            }),
            EPERM);
  if (sandbox_support().landlock >= 4)
    EXPECT_EQ(in_sandbox([&] { return try_to_connect(other.port()); }), EACCES);
}

TEST_F(Sandbox, NoProgramIsStartedAndNoProcessLookedInto) {
  EXPECT_EQ(in_sandbox([] { return error_of(::execl("/bin/true", "true", nullptr)); }), EPERM);
  EXPECT_NE(in_sandbox([] { return ::system("true") == 0 ? 0 : 1; }), 0);
  EXPECT_EQ(in_sandbox([] { return error_of(::ptrace(PTRACE_ATTACH, ::getppid(), nullptr, nullptr)); }),
            EPERM);
  EXPECT_EQ(in_sandbox([] { return error_of(::mknod("/tmp/device", S_IFCHR | 0600, 0)); }), EPERM);
}

TEST_F(Sandbox, ThreadsAndMemoryWorkAsBefore) {
  EXPECT_EQ(in_sandbox([&] {
              int sum = 0;
              std::vector<std::thread> threads;
              std::atomic<int> count{0};
              for (int i = 0; i < 4; ++i) threads.emplace_back([&] { ++count; });
              for (std::thread& t : threads) t.join();
              std::vector<std::uint8_t> large(50'000'000, 1);
              for (const std::uint8_t b : large) sum += b;
              return count == 4 && sum == 50'000'000 ? 9 : 0;
            }),
            9);
}

TEST(SandboxRulesOfAWorker, AreItsPlacesAndNoMore) {
  WorkerPlaces places;
  places.input = "scans/a/b.obj";
  places.output = "out/b.texmesh";
  places.cache = "/cache";
  places.layers = {"/shared"};
  SandboxRules rules = sandbox_rules(places);
  EXPECT_EQ(rules.read.front(), "scans/a");
  EXPECT_EQ(rules.read.back(), "/shared");
  EXPECT_EQ(rules.write, (std::vector<std::string>{"out", "/cache"}));
  EXPECT_FALSE(rules.network);
  places.program = "/opt/t/bin/texmesh";
  EXPECT_EQ(sandbox_rules(places).read[3], "/opt/t/bin/../lib");
  places.only_looks = true;
  places.output.clear();
  EXPECT_TRUE(sandbox_rules(places).write.empty());
  for (const char* name : {"http_proxy", "https_proxy", "HTTPS_PROXY", "all_proxy", "ALL_PROXY"})
    ::unsetenv(name);
  const std::map<std::string, std::uint16_t> ports{{"http://h", 80},       {"https://h/x", 443},
                                                   {"http://h:81", 81},    {"https://u:p@h:8443/c:9", 8443},
                                                   {"http://u:5@h/c", 80}, {"http://[::1]:82/c", 82},
                                                   {"http://[::1]/c", 80}};
  for (const auto& [url, port] : ports) {
    places.layers = {url};
    EXPECT_EQ(sandbox_rules(places).ports, (std::vector<std::uint16_t>{port, 53})) << url;
    EXPECT_TRUE(sandbox_rules(places).network);
  }
  ::setenv("https_proxy", "http://proxy:3128", 1);
  EXPECT_TRUE(sandbox_rules(places).ports.empty());
  ::unsetenv("https_proxy");
}

TEST(SandboxSupport, IsDescribedWithWhatIsMissing) {
  EXPECT_EQ(describe_sandbox({7, true}), "files (Landlock 7), calls (seccomp)");
  EXPECT_EQ(describe_sandbox({0, true}), "no bounds on files (no Landlock), calls (seccomp)");
  EXPECT_EQ(describe_sandbox({2, false}),
            "no bounds on files (Landlock 2, needs 3), no bounds on calls (no seccomp)");
  EXPECT_FALSE((SandboxSupport{2, true}.complete()));
  EXPECT_FALSE((SandboxSupport{7, false}.complete()));
}

}  // namespace texmesh::sandbox_test
