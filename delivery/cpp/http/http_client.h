#pragma once
#include <functional>
#include <memory>
#include <optional>

#include "format/base/bytes.h"

namespace texmesh {

/// Limits of what a server may do to us.
struct HttpOptions {
  int retries = 3;  // of one request without progress, after cut connections, stalls and 408, 429, 5xx
  double connect_timeout_s = 8;
  double stall_timeout_s = 8;     // without a byte
  double retry_delay_s = 0.2;     // before the first retry, doubled for each further one
  double most_retry_delay_s = 5;  // whatever Retry-After says
  double least_bytes_s = 1000;    // a request may take the two timeouts and its bytes at this rate in all
  std::uint64_t max_whole_bytes = 1ull << 30;  // of one answer, and of a file from a server without ranges
  std::function<bool()> cancelled;             // asked at least every second while requests are under way
};

/// http://host/path without user and password, for messages.
std::string shown_url(const std::string& url);
/// An http or https URL.
bool is_url(const std::string& text);

/// The answer to a request. `body` holds at most the bytes that were asked for.
struct HttpAnswer {
  long status = 0;  // 0: no answer at all, see `problem`
  std::string problem;
  Bytes body;
  std::string etag;                                 // strong ones only
  std::string type, encoding;                       // Content-Type, Content-Encoding; "" = not said
  std::string redirected_to;                        // where the answer came from, if not from the URL asked
  std::optional<std::uint64_t> first, last, total;  // of Content-Range; total of a 200: Content-Length
  std::optional<std::uint64_t> length;              // Content-Length
  bool complete = false;                            // the body ended as the server said it would
  bool too_long = false;     // more than asked for, or a whole file, was coming: the transfer was ended
  bool timed_out = false;    // silent, or slower than the options allow
  double retry_after_s = 0;  // as the server says, 0 = not
  double first_byte_s = 0, received_s = 0;  // from the request's last byte to the answer's first and last
};
/// Whether an answer is about the file that an answer with this strong ETag ("" = none) and total length (0 =
/// not known) was about. ETags decide where both have one, otherwise lengths; what cannot be compared counts
/// as the same.
bool is_same_file(const HttpAnswer& answer, const std::string& etag, std::uint64_t total);
/// Whether the request is worth another try.
bool may_retry(const HttpAnswer& answer);
/// The answer in a few words, for messages: "status 200 (text/html, 1734 bytes, redirected to
/// https://a.example/login)".
std::string describe_answer(const HttpAnswer& answer);
/// Whether the server compressed the bytes of the file, though nobody asked for that: then ranges are of
/// other bytes.
bool is_compressed(const HttpAnswer& answer);
/// Whether what came is a page for people, such as that of a login, in the place of a file. `begin`: its
/// first bytes.
bool is_page(const HttpAnswer& answer, ByteSpan begin);

/// Bytes first .. first + bytes - 1.
struct HttpRange {
  std::uint64_t first = 0, bytes = 0;
  bool or_whole = false;  // a server that knows no ranges may send the whole file instead
};

/// Makes GET requests, many at once, over at most so many connections to each server. Further requests wait.
/// Connections are kept open, and speak HTTP/2 where the server does. Follows no redirects to other
/// protocols. Not thread-safe.
class HttpPool {
 public:
  HttpPool(const HttpOptions& options, int connections_per_server);
  ~HttpPool();
  HttpPool(const HttpPool&) = delete;
  HttpPool& operator=(const HttpPool&) = delete;
  /// Asks once for a range, or without `range` for the whole file. `number` comes back with the answer. A
  /// server that knows ranges answers 206; on a 200 the transfer ends at once, and `body` is empty. The body
  /// of an error is not kept.
  void start(std::uint64_t number, const std::string& url, const std::optional<HttpRange>& range,
             std::uint64_t max_bytes);
  void cancel(std::uint64_t number);  // no answer will come
  /// The answer so far of a request under way; gone with cancel().
  const HttpAnswer* so_far(std::uint64_t number) const;
  struct Ended {
    std::uint64_t number = 0;
    HttpAnswer answer;
  };
  /// Waits at most so long for the next request that ends; returns at once when none is under way.
  std::optional<Ended> wait(double seconds);
  bool idle() const;
  const HttpOptions& options() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace texmesh
