#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace texmesh {

/// Limits of what a server may do to us.
struct HttpOptions {
  int retries = 3;  // of one request, after cut connections, stalls and statuses 408, 429, 5xx
  double connect_timeout_s = 10;
  double stall_timeout_s = 20;                 // without a byte
  double retry_delay_s = 0.2;                  // before the first retry, doubled for each further one
  std::uint64_t max_whole_bytes = 1ull << 30;  // of a file from a server that knows no ranges
};

/// http://host/path without user and password, for messages.
std::string shown_url(const std::string& url);
/// An http or https URL.
bool is_url(const std::string& text);

/// What came back. `body` holds at most what was asked for.
struct HttpAnswer {
  long status = 0;  // 0: no answer at all, see `problem`
  std::string problem;
  std::vector<std::uint8_t> body;
  std::string etag;                                 // strong ones only
  std::optional<std::uint64_t> first, last, total;  // of Content-Range
  bool complete = false;                            // the body ended as the server said it would
  bool too_long = false;                            // there was more than asked for: the transfer was ended
};

/// Bytes first .. first + bytes - 1.
struct HttpRange {
  std::uint64_t first = 0, bytes = 0;
};

/// One connection to one server, kept open between requests. Follows no redirects to other protocols. Not
/// thread-safe.
class HttpClient {
 public:
  using Range = HttpRange;
  explicit HttpClient(const HttpOptions& options);
  ~HttpClient();
  HttpClient(const HttpClient&) = delete;
  HttpClient& operator=(const HttpClient&) = delete;
  /// GET of a range (a 206, if the server knows ranges; on a 200 the transfer ends at once and `body` is
  /// empty), or of the whole file without `range`. One try, no retries.
  HttpAnswer get(const std::string& url, const std::optional<Range>& range, const std::string& if_range_etag,
                 std::uint64_t max_bytes);

 private:
  struct Handle;
  std::unique_ptr<Handle> handle_;
  HttpOptions options_;
};

/// Many requests at once, over at most so many connections to each server (more wait); HTTP/2 where a server
/// offers it. Not thread-safe.
class HttpPool {
 public:
  HttpPool(const HttpOptions& options, int connections_per_server);
  ~HttpPool();
  HttpPool(const HttpPool&) = delete;
  HttpPool& operator=(const HttpPool&) = delete;
  /// As HttpClient::get(); `number` comes back with the answer.
  void start(std::uint64_t number, const std::string& url, const std::optional<HttpRange>& range,
             std::uint64_t max_bytes);
  void cancel(std::uint64_t number);  // no answer will come
  struct Ended {
    std::uint64_t number = 0;
    HttpAnswer answer;
  };
  /// The next that has ended, waiting for it at most so long; at once when nothing is under way.
  std::optional<Ended> wait(double seconds);
  bool idle() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace texmesh
