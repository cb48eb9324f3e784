#pragma once
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "delivery/cpp/http/http_client.h"

namespace texmesh::testing {

// A web server that is a socket of the test, so that it can say what no server library would.

struct Request {
  int number = 0;  // of this server, from 0
  std::string path, if_range;
  bool ranged = false;
  std::uint64_t first = 0, last = 0;
};
struct Reply {
  std::string bytes;  // head and body, as they go out
  bool close = false;
  bool trickle = false;  // then a byte every 20 ms without end
};

inline std::string answer(int status, const std::string& headers, const std::string& body) {
  return "HTTP/1.1 " + std::to_string(status) + " X\r\nContent-Length: " + std::to_string(body.size()) +
         "\r\n" + headers + "\r\n" + body;
}

class RawServer {
 public:
  using Handler = std::function<Reply(const Request&)>;
  explicit RawServer(Handler handler) : handler_(std::move(handler)), fd_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(fd_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(fd_, 16), 0);
    ::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { accept_all(); });
  }
  ~RawServer() {
    stop_ = true;
    ::shutdown(fd_, SHUT_RDWR);
    thread_.join();
    for (const int connection : connections_) ::shutdown(connection, SHUT_RDWR);
    for (std::thread& server : servers_) server.join();
    for (const int connection : connections_) ::close(connection);
    ::close(fd_);
  }
  std::string url(const std::string& path) const {
    return "http://127.0.0.1:" + std::to_string(port_) + path;
  }
  std::vector<Request> requests() {
    const std::lock_guard lock(mutex_);
    return requests_;
  }

 private:
  void accept_all() {
    while (!stop_) {
      const int connection = ::accept(fd_, nullptr, nullptr);
      if (connection < 0) break;
      const std::lock_guard lock(mutex_);
      connections_.push_back(connection);
      servers_.emplace_back([this, connection] {  // clients keep connections open
        serve(connection);
        ::shutdown(connection, SHUT_RDWR);
      });
    }
  }
  void serve(int connection) {
    std::string head;
    for (;;) {
      char buffer[4096];
      const ssize_t n = ::recv(connection, buffer, sizeof buffer, 0);
      if (n <= 0) return;
      head.append(buffer, static_cast<std::size_t>(n));
      const std::size_t end = head.find("\r\n\r\n");
      if (end == std::string::npos) continue;
      const Reply reply = handler_(read_request(head.substr(0, end + 2)));
      head.erase(0, end + 4);
      for (std::size_t at = 0; at < reply.bytes.size();) {
        const ssize_t sent =
            ::send(connection, reply.bytes.data() + at, reply.bytes.size() - at, MSG_NOSIGNAL);
        if (sent <= 0) return;
        at += static_cast<std::size_t>(sent);
      }
      while (reply.trickle && !stop_) {
        if (::send(connection, "x", 1, MSG_NOSIGNAL) != 1) return;
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
      if (reply.close) return;
    }
  }
  Request read_request(const std::string& head) {
    Request r;
    r.path = head.substr(4, head.find(' ', 4) - 4);
    if (const std::size_t at = head.find("Range: bytes="); at != std::string::npos) {
      r.ranged = true;
      r.first = std::stoull(head.substr(at + 13));
      r.last = std::stoull(head.substr(head.find('-', at + 13) + 1));
    }
    if (const std::size_t at = head.find("If-Range: "); at != std::string::npos)
      r.if_range = head.substr(at + 10, head.find('\r', at) - at - 10);
    const std::lock_guard lock(mutex_);
    r.number = static_cast<int>(requests_.size());
    requests_.push_back(r);
    return r;
  }

  Handler handler_;
  int fd_, port_ = 0;
  std::thread thread_;
  std::vector<std::thread> servers_;
  std::vector<int> connections_;
  std::atomic<bool> stop_{false};
  std::mutex mutex_;
  std::vector<Request> requests_;
};

inline std::string text_of(const std::vector<std::uint8_t>& bytes) { return {bytes.begin(), bytes.end()}; }

inline std::string ranged(const std::string& file, const Request& r, const std::string& headers = "") {
  if (r.first >= file.size()) return answer(416, "", "");
  const std::uint64_t last = std::min<std::uint64_t>(r.last, file.size() - 1);
  return answer(206,
                "Content-Range: bytes " + std::to_string(r.first) + "-" + std::to_string(last) + "/" +
                    std::to_string(file.size()) + "\r\n" + headers,
                file.substr(r.first, last - r.first + 1));
}

inline HttpOptions quick() {
  HttpOptions o;
  o.retry_delay_s = 0.001;
  o.stall_timeout_s = 0.6;
  o.connect_timeout_s = 2;
  return o;
}

}  // namespace texmesh::testing
