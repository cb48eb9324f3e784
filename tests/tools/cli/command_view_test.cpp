// texmesh view as a program: what it serves, to whom, and what it must not.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <httplib.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "pipeline/io/uri.h"
#include "tests/support/command.h"
#include "tools/publish/view/view_server.h"

namespace texmesh::testing::command_view_test {

namespace fs = std::filesystem;
using Json = nlohmann::json;
const std::string kGolden = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";

/// A viewer of two files, one of them hidden, and packages in every form.
class CliView : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "viewer/assets");
    write_text(folder_ / "viewer/index.html", "<!doctype html>");
    write_text(folder_ / "viewer/assets/app.js", "export {};");
    write_text(folder_ / "viewer/.secret", "hidden");
    write_text(folder_ / "viewer/empty.txt", "");
    write_text(folder_ / "outside.texmesh", "outside");
    fs::create_directories(folder_ / "all/more");
    fs::copy(kGolden, folder_ / "all/a scan.texmesh");
    fs::copy(kGolden, folder_ / "all/more/b.texmesh");
    write_text(folder_ / "all/notes.txt", "not a package");
    fs::create_symlink(folder_ / "outside.texmesh", folder_ / "all/link.texmesh");
    fs::create_symlink(folder_.path(), folder_ / "all/up");
    const CommandResult r = run_command({TEXMESH_BINARY, "unpack", kGolden, "-o", folder_ / "all/tree"});
    ASSERT_EQ(r.exit_code, 0) << r.errors;
    ASSERT_EQ(::mkfifo((folder_ / "all/fifo.texmesh").c_str(), 0600), 0);
  }
  void TearDown() override {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
    }
  }

  /// Starts the command and reads the line that it announces itself with.
  Json start(const std::string& package, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments{TEXMESH_BINARY,     "view",  package, "--viewer",
                                       folder_ / "viewer", "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    std::vector<char*> argv;
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    int pipe[2];
    EXPECT_EQ(::pipe(pipe), 0);
    pid_ = ::fork();
    if (pid_ == 0) {
      ::dup2(pipe[1], 1);
      ::execv(argv[0], argv.data());
      ::_exit(127);
    }
    ::close(pipe[1]);
    std::string line;
    for (char c; ::read(pipe[0], &c, 1) == 1 && c != '\n';) line += c;
    ::close(pipe[0]);
    const Json said = Json::parse(line, nullptr, false);
    EXPECT_TRUE(said.is_object()) << line;
    const std::string url = said.value("url", "");
    port_ = std::atoi(url.substr(url.rfind(':') + 1).c_str());
    return said;
  }
  httplib::Client client() const {
    httplib::Client c("127.0.0.1", port_);
    c.set_url_encode(false);
    return c;
  }
  int status(const std::string& path) const {
    const auto r = client().Get(path);
    return r ? r->status : -1;
  }
  /// The status line of a request as it stands, for what no client library would say.
  std::string raw(const std::string& request) const {
    const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port_));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(fd, reinterpret_cast<sockaddr*>(&to), sizeof to), 0);
    EXPECT_EQ(::send(fd, request.data(), request.size(), MSG_NOSIGNAL), static_cast<ssize_t>(request.size()));
    ::shutdown(fd, SHUT_WR);
    std::string answer;
    char buffer[4096];
    for (ssize_t n; (n = ::recv(fd, buffer, sizeof buffer, 0)) > 0;)
      answer.append(buffer, static_cast<std::size_t>(n));
    ::close(fd);
    return answer.substr(0, answer.find('\r'));
  }

  TemporaryFolder folder_;
  pid_t pid_ = -1;
  int port_ = 0;
};

TEST_F(CliView, NamesWithMarksStandInTheQueryAsAUrlDoes) {
  fs::copy_file(kGolden, folder_ / "a b#?.texmesh");
  const Json said = start(folder_ / "a b#?.texmesh");
  EXPECT_NE(said["url"].get<std::string>().find("/?pkg=packages/a%2520b%2523%253F.texmesh"),
            std::string::npos)
      << said["url"];
  EXPECT_EQ(client().Get("/packages/a%20b%23%3F.texmesh")->status, 200);
}

TEST_F(CliView, ServesThePageThePackageAndItsRanges) {
  const Json said = start(kGolden);
  EXPECT_NE(said["url"].get<std::string>().find("/?pkg=packages/v2.0-scan.texmesh"), std::string::npos);
  const std::string bytes = read_text(kGolden), path = "/packages/v2.0-scan.texmesh";
  const auto page = client().Get("/");
  ASSERT_TRUE(page);
  EXPECT_EQ(page->body, "<!doctype html>");
  EXPECT_EQ(page->get_header_value("Content-Type"), "text/html; charset=utf-8");
  EXPECT_EQ(client().Get("/assets/app.js")->get_header_value("Content-Type"),
            "text/javascript; charset=utf-8");
  EXPECT_EQ(status("/empty.txt"), 200);

  const auto whole = client().Get(path);
  ASSERT_EQ(whole->status, 200);
  EXPECT_EQ(whole->body, bytes);
  EXPECT_EQ(whole->get_header_value("Accept-Ranges"), "bytes");
  EXPECT_EQ(whole->get_header_value("Access-Control-Allow-Origin"), "*");
  EXPECT_NE(whole->get_header_value("Access-Control-Expose-Headers").find("Content-Range"),
            std::string::npos);
  EXPECT_EQ(whole->get_header_value("Content-Encoding"), "");
  const std::string etag = whole->get_header_value("ETag");
  ASSERT_EQ(etag.front(), '"');

  const auto part = client().Get(path, {{"Range", "bytes=100-299"}, {"If-Range", etag}});
  ASSERT_EQ(part->status, 206);
  EXPECT_EQ(part->body, bytes.substr(100, 200));
  EXPECT_EQ(part->get_header_value("Content-Range"), "bytes 100-299/" + std::to_string(bytes.size()));
  EXPECT_EQ(client().Get(path, {{"Range", "bytes=-7"}})->body, bytes.substr(bytes.size() - 7));
  EXPECT_EQ(client().Get(path, {{"Range", "bytes=100-"}})->body, bytes.substr(100));
  EXPECT_EQ(client().Get(path, {{"Range", "bytes=0-99"}, {"If-Range", "\"other\""}})->status, 200);
  EXPECT_EQ(client().Get(path, {{"Range", "bytes=999999999-"}})->status, 416);
  EXPECT_EQ(client().Get(path, {{"If-None-Match", etag}})->status, 304);
  const auto head = client().Head(path);
  EXPECT_EQ(head->status, 200);
  EXPECT_EQ(head->get_header_value("Content-Length"), std::to_string(bytes.size()));
  const CommandResult dump =
      run_command({TEXMESH_BINARY, "verify", "http://127.0.0.1:" + std::to_string(port_) + path});
  EXPECT_EQ(dump.exit_code, 0) << dump.errors;
}

TEST_F(CliView, ReachesPackagesOnlyAndReadsOnly) {
  const Json said = start(folder_ / "all");
  EXPECT_EQ(said["packages"].size(), 3u) << said;
  const Json list = Json::parse(client().Get("/packages.json")->body);
  EXPECT_EQ(list["packages"][0]["url"], "packages/a%20scan.texmesh");
  EXPECT_TRUE(list["packages"][0].contains("poster"));
  EXPECT_EQ(status("/posters/a%20scan.texmesh"), 200);
  EXPECT_TRUE(list["packages"][2].contains("poster")) << list;
  EXPECT_EQ(client().Get("/posters/tree/")->body, read_text(folder_ / "all/tree/poster.jpg"));
  for (const char* none :
       {"/posters/notes.txt", "/posters/link.texmesh", "/posters/up/all/tree/", "/posters/"})
    EXPECT_EQ(status(none), 404) << none;
  write_text(folder_ / "all/tree/poster.jpg", "another picture");
  EXPECT_EQ(status("/posters/tree/"), 404);
  for (const char* there : {"/packages/a%20scan.texmesh", "/packages/more/b.texmesh",
                            "/packages/tree/manifest.json", "/packages/tree/mesh/s00.glb"})
    EXPECT_EQ(status(there), 200) << there;
  EXPECT_EQ(client().Get("/packages/tree/mesh/s00.glb")->get_header_value("Content-Type"),
            "model/gltf-binary");
  for (const char* not_there :
       {"/packages/notes.txt", "/packages/link.texmesh", "/packages/fifo.texmesh",
        "/packages/up/outside.texmesh", "/packages/../outside.texmesh", "/packages/%2e%2e/outside.texmesh",
        "/packages/more/../../outside.texmesh", "/packages//more/b.texmesh", "/packages/tree",
        "/packages/tree/", "/packages/", "/.secret", "/assets", "/../outside.texmesh",
        "/packages/a%20scan.texmesh/x", "/packages/a%20scan.texmesh%00.txt"})
    EXPECT_EQ(status(not_there), 404) << not_there;
  EXPECT_EQ(client().Post("/packages/more/b.texmesh", "x", "text/plain")->status, 405);
  EXPECT_EQ(client().Delete("/packages/more/b.texmesh")->status, 405);
  EXPECT_EQ(client().Options("/packages/more/b.texmesh")->get_header_value("Access-Control-Allow-Methods"),
            "GET, HEAD");
  for (const std::string& bad :
       {std::string("GET /packages/../../etc/passwd HTTP/1.1\r\nHost: x\r\n\r\n"), std::string("\r\n\r\n"),
        std::string("GET /packages/more/b.texmesh HTTP/1.1\r\nRange: bytes=") + std::string(30, '9') +
            "-\r\n\r\n",
        std::string("GET / HTTP/1.1\r\nRange: bytes=") + std::string(4000, ',') + "\r\n\r\n",
        std::string("GET /") + std::string(100000, 'a') + " HTTP/1.1\r\n\r\n"})
    EXPECT_EQ(raw(bad).find(" 206"), std::string::npos) << bad.substr(0, 60);
  EXPECT_EQ(status("/"), 200) << "it still serves";
}

TEST_F(CliView, EndsOnSignalsWithOpenConnections) {
  for (const int signal : {SIGINT, SIGTERM}) {
    start(folder_ / "all/tree");
    httplib::Client kept("127.0.0.1", port_);
    kept.set_keep_alive(true);
    EXPECT_EQ(kept.Get("/packages/tree/manifest.json")->status, 200);
    ::kill(pid_, signal);
    int status = 0;
    EXPECT_EQ(::waitpid(pid_, &status, 0), pid_);
    pid_ = -1;
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  }
}

TEST_F(CliView, SaysWhatIsMissing) {
  auto fails = [&](std::vector<std::string> arguments, const std::string& with) {
    arguments.insert(arguments.begin(), {TEXMESH_BINARY, "view"});
    const CommandResult r = run_command(arguments, {}, "", 20);
    EXPECT_EQ(r.exit_code, 1) << r.output;
    EXPECT_NE(r.errors.find(with), std::string::npos) << r.errors;
  };
  const std::string viewer = folder_ / "viewer";
  fails({folder_ / "none", "--viewer", viewer}, "none: cannot be read: No such file or directory");
  fails({viewer, "--viewer", viewer}, "no package in it");
  fails({folder_ / "all/fifo.texmesh", "--viewer", viewer}, "a regular file");
  fails({kGolden, "--viewer", folder_ / "all"}, "--target viewer");
  start(kGolden);
  fails({kGolden, "--viewer", viewer, "--port", std::to_string(port_)}, "in use");
  EXPECT_EQ(run_command({TEXMESH_BINARY, "view"}).exit_code, 2);
  EXPECT_EQ(run_command({TEXMESH_BINARY, "view", kGolden, "--port", "99999"}).exit_code, 2);
}

TEST(RequestedRange, FollowsTheRulesOfRanges) {
  const auto of = [](const std::string& header, std::uint64_t size = 100) {
    const RequestedRange r = requested_range(header, size);
    return std::to_string(r.kind) + ":" + std::to_string(r.first) + "+" + std::to_string(r.bytes);
  };
  const std::string none = "0:0+0", bad = "2:0+0";
  EXPECT_EQ(of("bytes=0-0"), "1:0+1");
  EXPECT_EQ(of("bytes=10-19"), "1:10+10");
  EXPECT_EQ(of("bytes=10-"), "1:10+90");
  EXPECT_EQ(of("bytes=10-1000"), "1:10+90");
  EXPECT_EQ(of("bytes=-10"), "1:90+10");
  EXPECT_EQ(of("bytes=-1000"), "1:0+100");
  EXPECT_EQ(of("bytes=99-18446744073709551615"), "1:99+1");
  for (const char* h : {"bytes=100-", "bytes=-0"}) EXPECT_EQ(of(h), bad) << h;
  EXPECT_EQ(of("bytes=0-", 0), bad);
  EXPECT_EQ(of("bytes=-5", 0), bad);
  for (const char* h :
       {"", "bytes", "bytes=", "bytes=-", "bytes=5", "bytes=9-3", "bytes=0-1,4-5", "items=0-1", "bytes=a-b",
        "bytes= 0-1", "bytes=+1-2", "bytes=99999999999999999999-", "bytes=1--2"})
    EXPECT_EQ(of(h), none) << h;
}

TEST(PercentEncoded, LeavesNothingThatAUrlCouldMisread) {
  EXPECT_EQ(percent_encoded("a b/%?#&+\xc3\xa4.texmesh"), "a%20b/%25%3F%23%26%2B%C3%A4.texmesh");
}

}  // namespace texmesh::testing::command_view_test
