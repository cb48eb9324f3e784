// Answers of a server, as the reader of packages over HTTP sees them, without a network: connections are made
// to pairs of sockets that hold the next answer. curl itself is part of what runs.
#include <dlfcn.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <deque>

#include "delivery/cpp/package/http_store.h"
#include "delivery/cpp/package/package_reader.h"
#include "format/base/errors.h"
#include "tests/format/container/package_fixture.h"
#include "tests/fuzz/fuzz_target.h"

namespace texmesh::fuzz {
namespace {

/// The answers of the run that is under way, one for each connection; null outside of read_answers().
std::deque<ByteSpan>* answers = nullptr;

/// A connected socket with the next answer in it, at its end.
int answered_socket() {
  std::array<int, 2> pair{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, pair.data()) != 0) return -1;
  if (!answers->empty()) {
    const ByteSpan answer = answers->front();
    answers->pop_front();
    // What does not fit the socket's buffer is cut off.
    [[maybe_unused]] const auto sent = ::send(pair[1], answer.data(), answer.size(), MSG_NOSIGNAL);
  }
  ::shutdown(pair[1], SHUT_WR);
  static int kept = -1;  // the other end of the last one: with it closed, sending the request would fail
  if (kept >= 0) ::close(kept);
  kept = pair[1];
  return pair[0];
}

constexpr std::uint8_t kNextAnswer = 0x1e;  // ASCII's record separator; a package that holds it is cut, too

bool read_answers(ByteSpan input) {
  std::deque<ByteSpan> parts;
  for (std::size_t at = 0; at <= input.size();) {
    std::size_t end = at;
    while (end < input.size() && input[end] != kNextAnswer) ++end;
    parts.push_back(input.subspan(at, end - at));
    at = end + 1;
  }
  HttpOptions options;
  options.retries = 1;
  options.retry_delay_s = options.most_retry_delay_s = 0;
  options.stall_timeout_s = options.connect_timeout_s = 0.2;
  options.max_whole_bytes = 1 << 20;
  answers = &parts;
  bool good = false;
  try {
    PackageReader reader(open_url("http://127.0.0.1/a.texmesh", options));
    reader.index();
    reader.textures();
    good = true;
  } catch (const FormatError&) {
  } catch (const InputError&) {
  }
  answers = nullptr;
  return good;
}

std::vector<Bytes> http_seeds() {
  const Bytes package = texmesh::testing::make_package(0);
  const std::string body(package.begin(), package.end()), total = std::to_string(body.size());
  const std::string separator(1, static_cast<char>(kNextAnswer));
  const std::string range = "HTTP/1.1 206 Partial Content\r\nETag: \"a\"\r\nContent-Range: bytes 0-" +
                            std::to_string(body.size() - 1) + "/" + total + "\r\nContent-Length: " + total +
                            "\r\n\r\n" + body;
  const std::string whole = "HTTP/1.1 200 OK\r\nContent-Length: " + total + "\r\n\r\n" + body;
  return {
      to_bytes(range),
      to_bytes(whole + separator + "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n" + separator + whole),
      to_bytes("HTTP/1.1 503 Busy\r\nRetry-After: 1\r\n\r\n" + separator + range),
      to_bytes("HTTP/1.1 302 Found\r\nLocation: http://127.0.0.1/b.texmesh\r\nContent-Length: 0\r\n\r\n" +
               separator + range)};
}

}  // namespace

void add_http_targets(std::vector<Target>& list) {
  list.push_back(
      {"http",
       false,
       read_answers,
       http_seeds,
       Shape::kBytes,
       nullptr,
       {"HTTP/1.1 200 OK\r\n", "HTTP/1.1 206 Partial Content\r\n", "HTTP/1.1 404 No\r\n", "HTTP/2 200\r\n",
        "Content-Range: bytes 0-99/100\r\n", "Content-Length: ", "ETag: \"a\"\r\n", "ETag: W/\"a\"\r\n",
        "Retry-After: 9\r\n", "Transfer-Encoding: chunked\r\n", "Connection: close\r\n", "Location: /b\r\n",
        "\r\n\r\n", std::string(1, '\x1e')}});
}

}  // namespace texmesh::fuzz

// The program's own, in front of the C library's: curl's connections end here while a target runs.
extern "C" int socket(int domain, int type, int protocol) {
  using Socket = int (*)(int, int, int);
  static const auto next = reinterpret_cast<Socket>(::dlsym(RTLD_NEXT, "socket"));
  if (texmesh::fuzz::answers && domain == AF_INET) return texmesh::fuzz::answered_socket();
  return next(domain, type, protocol);
}

extern "C" int connect(int fd, const sockaddr* address, socklen_t length) {
  using Connect = int (*)(int, const sockaddr*, socklen_t);
  static const auto next = reinterpret_cast<Connect>(::dlsym(RTLD_NEXT, "connect"));
  if (texmesh::fuzz::answers && address->sa_family == AF_INET) return 0;
  return next(fd, address, length);
}
