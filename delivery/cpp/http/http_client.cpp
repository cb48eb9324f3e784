#include "delivery/cpp/http/http_client.h"

#include <curl/curl.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <map>

namespace texmesh {
namespace {

using Clock = std::chrono::steady_clock;

constexpr long kMaxRedirects = 5;
constexpr double kMostPoll_ms = 250;  // between looks at whether requests are cancelled
// Error pages are read to their end when they are short, which keeps the connection, but not for long.
constexpr std::uint64_t kMostErrorBytes = 4096;
constexpr double kMostError_s = 0.5;

struct Transfer {
  CURL* handle = nullptr;
  HttpAnswer answer;
  std::uint64_t max_bytes = 0;
  std::optional<HttpRange> range;
  const HttpOptions* options = nullptr;
  std::optional<Clock::time_point> sent, error_page;  // the request; the first byte of an answer of no use
  Clock::time_point moved{};                          // when a byte came last, or the request was sent
  std::uint64_t bytes = 0;                            // by then
};

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

bool starts_with_name(std::string_view line, std::string_view name, std::string_view& value) {
  if (line.size() <= name.size() || line[name.size()] != ':') return false;
  for (std::size_t i = 0; i < name.size(); ++i)
    if ((line[i] | 0x20) != name[i]) return false;
  value = line.substr(name.size() + 1);
  value.remove_prefix(std::min(value.find_first_not_of(' '), value.size()));
  value.remove_suffix(value.size() - (value.find_last_not_of("\r\n ") + 1));
  return true;
}

std::optional<std::uint64_t> number(std::string_view& text) {
  std::uint64_t n = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), n);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return n;
}

/// "bytes 0-99/1234", or with "*" for a total that the server does not know; anything else leaves the answer
/// without a range.
void read_content_range(std::string_view value, HttpAnswer& answer) {
  if (!value.starts_with("bytes ")) return;
  value.remove_prefix(6);
  const auto first = number(value);
  if (!first || !value.starts_with('-')) return;
  value.remove_prefix(1);
  const auto last = number(value);
  if (!last || !value.starts_with('/')) return;
  value.remove_prefix(1);
  const bool unknown = value == "*";
  const auto total = unknown ? std::nullopt : number(value);
  if (*last < *first || (!unknown && (!total || !value.empty() || *last >= *total))) return;
  answer.first = first;
  answer.last = last;
  answer.total = total;
}

/// What a message may show of a header's value.
std::string printable_part(std::string_view value) {
  std::string out(value.substr(0, 100));
  std::ranges::replace_if(
      out, [](char c) { return c < ' ' || c > '~'; }, '?');
  return out;
}

std::size_t receive_header(char* data, std::size_t size, std::size_t count, void* user) {
  auto& transfer = *static_cast<Transfer*>(user);
  const std::string_view line(data, size * count);
  std::string_view value;
  if (line.starts_with("HTTP/")) {  // of another answer after a redirect
    HttpAnswer& a = transfer.answer;
    for (std::string* said : {&a.etag, &a.type, &a.encoding}) said->clear();
    a.length = a.first = a.last = a.total = std::nullopt;
  } else if (starts_with_name(line, "content-range", value)) {
    read_content_range(value, transfer.answer);
  } else if (starts_with_name(line, "content-length", value)) {
    transfer.answer.length = number(value);
  } else if (starts_with_name(line, "content-type", value)) {
    transfer.answer.type = printable_part(value);
  } else if (starts_with_name(line, "content-encoding", value)) {
    transfer.answer.encoding = printable_part(value);
  } else if (starts_with_name(line, "etag", value) && value.starts_with('"')) {
    transfer.answer.etag = std::string(value.substr(0, 200));
  } else if (starts_with_name(line, "retry-after", value)) {
    const auto seconds = number(value);
    if (seconds && value.empty()) transfer.answer.retry_after_s = static_cast<double>(*seconds);
  }
  return size * count;
}

std::size_t receive_body(char* data, std::size_t size, std::size_t count, void* user) {
  auto& transfer = *static_cast<Transfer*>(user);
  long status = 0;
  ::curl_easy_getinfo(transfer.handle, CURLINFO_RESPONSE_CODE, &status);
  if (status != 200 && status != 206) {
    if (!transfer.error_page) transfer.error_page = Clock::now();
    curl_off_t length = -1;
    ::curl_easy_getinfo(transfer.handle, CURLINFO_CONTENT_LENGTH_DOWNLOAD_T, &length);
    const bool is_short = length >= 0 && static_cast<std::uint64_t>(length) <= kMostErrorBytes;
    return is_short ? size * count : 0;
  }
  if (transfer.range && !transfer.range->or_whole && status == 200) {
    transfer.answer.too_long = true;
    return 0;
  }
  HttpAnswer& answer = transfer.answer;
  if (answer.body.size() + size * count > transfer.max_bytes) {
    answer.too_long = true;
    return 0;
  }
  answer.body.insert(answer.body.end(), data, data + size * count);
  return size * count;
}

/// Called by curl now and then, whether something came or not: not 0 ends the transfer.
int look(void* user, curl_off_t, curl_off_t received, curl_off_t, curl_off_t) {
  auto& transfer = *static_cast<Transfer*>(user);
  const HttpOptions& options = *transfer.options;
  if (options.cancelled && options.cancelled()) {
    transfer.answer.problem = "cancelled";
    return 1;
  }
  if (transfer.error_page && seconds_since(*transfer.error_page) > kMostError_s) return 1;
  if (!transfer.sent) {  // one that waits for a connection has all the time
    curl_off_t us = 0;
    ::curl_easy_getinfo(transfer.handle, CURLINFO_PRETRANSFER_TIME_T, &us);
    if (us > 0) transfer.sent = transfer.moved = Clock::now();
    return 0;
  }
  // curl's own limit looks at the mean of some seconds, in which a server that has sent something is fast.
  if (static_cast<std::uint64_t>(received) != transfer.bytes) {
    transfer.bytes = static_cast<std::uint64_t>(received);
    transfer.moved = Clock::now();
  }
  const bool silent = seconds_since(transfer.moved) > options.stall_timeout_s;
  const double most_s = options.connect_timeout_s + options.stall_timeout_s +
                        static_cast<double>(transfer.max_bytes) / options.least_bytes_s;
  if (!silent && seconds_since(*transfer.sent) <= most_s) return 0;
  transfer.answer.problem =
      silent ? "no byte for " + std::to_string(options.stall_timeout_s).substr(0, 3) + " s" : "too slow";
  transfer.answer.timed_out = true;
  return 1;
}

/// As browsers send it: people paste addresses with spaces and letters of their own.
std::string sent_url(const std::string& url) {
  std::string out;
  for (const char c : url) {
    constexpr const char* kHex = "0123456789ABCDEF";
    const auto byte = static_cast<unsigned char>(c);
    if (byte > ' ' && byte < 127)
      out += c;
    else
      (out += '%').append({kHex[byte >> 4], kHex[byte & 15]});
  }
  return out;
}

/// Sets the handle up for a GET; the headers belong to the caller and must live as long as the transfer.
curl_slist* prepare(Transfer& transfer, const std::string& url) {
  CURL* h = transfer.handle;
  const HttpOptions& options = *transfer.options;
  const std::optional<HttpRange>& range = transfer.range;
  ::curl_easy_setopt(h, CURLOPT_URL, sent_url(url).c_str());
  ::curl_easy_setopt(h, CURLOPT_PROTOCOLS_STR, "http,https");
  ::curl_easy_setopt(h, CURLOPT_REDIR_PROTOCOLS_STR, "http,https");
  ::curl_easy_setopt(h, CURLOPT_FOLLOWLOCATION, 1L);
  ::curl_easy_setopt(h, CURLOPT_MAXREDIRS, kMaxRedirects);
  ::curl_easy_setopt(h, CURLOPT_NOSIGNAL, 1L);
  ::curl_easy_setopt(h, CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(options.connect_timeout_s * 1000));
  ::curl_easy_setopt(h, CURLOPT_USERAGENT, "texmesh");
  ::curl_easy_setopt(h, CURLOPT_HEADERFUNCTION, receive_header);
  ::curl_easy_setopt(h, CURLOPT_HEADERDATA, &transfer);
  ::curl_easy_setopt(h, CURLOPT_WRITEFUNCTION, receive_body);
  ::curl_easy_setopt(h, CURLOPT_WRITEDATA, &transfer);
  ::curl_easy_setopt(h, CURLOPT_NOPROGRESS, 0L);
  ::curl_easy_setopt(h, CURLOPT_XFERINFOFUNCTION, look);
  ::curl_easy_setopt(h, CURLOPT_XFERINFODATA, &transfer);
  curl_slist* headers = nullptr;
  if (!range) {
    ::curl_easy_setopt(h, CURLOPT_ACCEPT_ENCODING,
                       "identity");  // and what is compressed all the same is decoded
  } else {
    headers = ::curl_slist_append(nullptr, "Accept-Encoding: identity");  // ranges are of the bytes as stored
    const std::string asked = "Range: bytes=" + std::to_string(range->first) + "-" +
                              std::to_string(range->first + range->bytes - 1);
    headers = ::curl_slist_append(headers, asked.c_str());
  }
  ::curl_easy_setopt(h, CURLOPT_HTTPHEADER, headers);
  return headers;
}

void conclude(Transfer& transfer, CURLcode rc) {
  HttpAnswer& answer = transfer.answer;
  ::curl_easy_getinfo(transfer.handle, CURLINFO_RESPONSE_CODE, &answer.status);
  answer.complete = rc == CURLE_OK;
  if (answer.status == 200 && !is_compressed(answer)) answer.total = answer.length;
  long redirects = 0;
  const char* url = nullptr;
  ::curl_easy_getinfo(transfer.handle, CURLINFO_REDIRECT_COUNT, &redirects);
  if (redirects > 0 && ::curl_easy_getinfo(transfer.handle, CURLINFO_EFFECTIVE_URL, &url) == CURLE_OK && url)
    answer.redirected_to = shown_url(url);
  curl_off_t sent_us = 0, first_us = 0, total_us = 0;
  ::curl_easy_getinfo(transfer.handle, CURLINFO_PRETRANSFER_TIME_T, &sent_us);
  ::curl_easy_getinfo(transfer.handle, CURLINFO_STARTTRANSFER_TIME_T, &first_us);
  ::curl_easy_getinfo(transfer.handle, CURLINFO_TOTAL_TIME_T, &total_us);
  answer.first_byte_s = 1e-6 * static_cast<double>(std::max<curl_off_t>(0, first_us - sent_us));
  answer.received_s = 1e-6 * static_cast<double>(std::max<curl_off_t>(0, total_us - sent_us));
  if (rc == CURLE_OPERATION_TIMEDOUT) {
    answer.timed_out = true;
    answer.problem = "no connection in time";
  }
  if (rc != CURLE_OK && answer.problem.empty()) answer.problem = ::curl_easy_strerror(rc);
}

}  // namespace

std::string shown_url(const std::string& url) {
  const std::size_t scheme = url.find("://");
  if (scheme == std::string::npos) return url;
  const std::size_t host = scheme + 3, path = std::min(url.find('/', host), url.size());
  const std::size_t at = url.rfind('@', path);
  return at == std::string::npos || at < host ? url : url.substr(0, host) + url.substr(at + 1);
}

bool is_url(const std::string& text) { return text.starts_with("http://") || text.starts_with("https://"); }

bool is_same_file(const HttpAnswer& a, const std::string& etag, std::uint64_t total) {
  if (!a.etag.empty() && !etag.empty()) return a.etag == etag;
  return !a.total || total == 0 || *a.total == total;
}

bool may_retry(const HttpAnswer& a) {
  return a.problem != "cancelled" &&
         (a.status == 0 || a.status == 408 || a.status == 429 || a.status >= 500 ||
          ((a.status == 200 || a.status == 206) && !a.complete && !a.too_long));
}

std::string describe_answer(const HttpAnswer& a) {
  if (a.status == 0) return a.problem.empty() ? "no answer" : a.problem;
  std::string what;
  const auto add = [&](const std::string& text) { what += (what.empty() ? "" : ", ") + text; };
  if (!a.type.empty()) add(a.type);
  if (!a.encoding.empty()) add(a.encoding);
  if (a.length) add(std::to_string(*a.length) + " bytes");
  if (!a.redirected_to.empty()) add("redirected to " + a.redirected_to);
  const std::string status = "status " + std::to_string(a.status) + (what.empty() ? "" : " (" + what + ")");
  const bool is_file = a.status == 200 || a.status == 206;
  return is_file && !a.problem.empty() ? a.problem + ", " + status : status;
}

bool is_compressed(const HttpAnswer& a) { return !a.encoding.empty() && a.encoding != "identity"; }

bool is_page(const HttpAnswer& a, ByteSpan begin) {
  const auto first = std::ranges::find_if(begin, [](std::uint8_t c) { return c > ' '; });
  return a.type.starts_with("text/html") && first != begin.end() && *first == '<';
}

struct HttpPool::State {
  struct Running {
    Transfer transfer;
    curl_slist* headers = nullptr;
    ~Running() {
      ::curl_slist_free_all(headers);
      ::curl_easy_cleanup(transfer.handle);
    }
  };
  CURLM* multi = nullptr;
  HttpOptions options;
  std::map<std::uint64_t, std::unique_ptr<Running>> running;

  ~State() {
    while (!running.empty()) drop(running.begin()->first);
    ::curl_multi_cleanup(multi);
  }
  void drop(std::uint64_t number) {
    const auto it = running.find(number);
    if (it == running.end()) return;
    ::curl_multi_remove_handle(multi, it->second->transfer.handle);
    running.erase(it);
  }
  std::optional<Ended> ended() {
    int left = 0;
    while (const CURLMsg* message = ::curl_multi_info_read(multi, &left)) {
      if (message->msg != CURLMSG_DONE) continue;
      const CURLcode rc = message->data.result;
      for (auto& [number, r] : running) {
        if (r->transfer.handle != message->easy_handle) continue;
        conclude(r->transfer, rc);
        Ended ended{number, std::move(r->transfer.answer)};
        drop(number);
        return ended;
      }
    }
    return std::nullopt;
  }
};

HttpPool::HttpPool(const HttpOptions& options, int connections_per_server)
    : state_(std::make_unique<State>()) {
  [[maybe_unused]] static const CURLcode started = ::curl_global_init(CURL_GLOBAL_DEFAULT);
  state_->multi = ::curl_multi_init();
  state_->options = options;
  ::curl_multi_setopt(state_->multi, CURLMOPT_MAX_HOST_CONNECTIONS,
                      static_cast<long>(connections_per_server));
  ::curl_multi_setopt(state_->multi, CURLMOPT_PIPELINING, static_cast<long>(CURLPIPE_MULTIPLEX));
}
HttpPool::~HttpPool() = default;

void HttpPool::start(std::uint64_t number, const std::string& url, const std::optional<HttpRange>& range,
                     std::uint64_t max_bytes) {
  cancel(number);
  auto running = std::make_unique<State::Running>();
  Transfer& transfer = running->transfer;
  transfer.handle = ::curl_easy_init();
  transfer.max_bytes = std::min(max_bytes, state_->options.max_whole_bytes);
  transfer.range = range;
  transfer.options = &state_->options;
  running->headers = prepare(transfer, url);
  ::curl_multi_add_handle(state_->multi, running->transfer.handle);
  state_->running[number] = std::move(running);
}

void HttpPool::cancel(std::uint64_t number) { state_->drop(number); }
bool HttpPool::idle() const { return state_->running.empty(); }
const HttpOptions& HttpPool::options() const { return state_->options; }

const HttpAnswer* HttpPool::so_far(std::uint64_t number) const {
  const auto it = state_->running.find(number);
  return it == state_->running.end() ? nullptr : &it->second->transfer.answer;
}

std::optional<HttpPool::Ended> HttpPool::wait(double seconds) {
  const Clock::time_point start = Clock::now();
  for (;;) {
    int active = 0;
    ::curl_multi_perform(state_->multi, &active);
    if (auto ended = state_->ended()) return ended;
    const double left_ms = 1000 * (seconds - seconds_since(start));
    if (left_ms <= 0 || idle()) return std::nullopt;
    ::curl_multi_poll(state_->multi, nullptr, 0, static_cast<int>(std::clamp(left_ms, 1.0, kMostPoll_ms)),
                      nullptr);
  }
}

}  // namespace texmesh
