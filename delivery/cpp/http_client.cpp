#include "delivery/cpp/http_client.h"

#include <curl/curl.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <map>
#include <mutex>
#include <string_view>

namespace texmesh {
namespace {

constexpr long kMaxRedirects = 5;

struct Transfer {
  CURL* handle;
  HttpAnswer answer;
  std::uint64_t max_bytes;
  bool wants_range;
};

bool starts_with_name(std::string_view line, std::string_view name, std::string_view& value) {
  if (line.size() <= name.size() || line[name.size()] != ':') return false;
  for (std::size_t i = 0; i < name.size(); ++i)
    if ((line[i] | 0x20) != name[i]) return false;
  value = line.substr(name.size() + 1);
  while (!value.empty() && value.front() == ' ') value.remove_prefix(1);
  while (!value.empty() && (value.back() == '\r' || value.back() == '\n' || value.back() == ' '))
    value.remove_suffix(1);
  return true;
}

std::optional<std::uint64_t> number(std::string_view& text) {
  std::uint64_t n = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), n);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return n;
}

/// "bytes 0-99/1234"; anything else leaves the answer without a range.
void read_content_range(std::string_view value, HttpAnswer& answer) {
  if (!value.starts_with("bytes ")) return;
  value.remove_prefix(6);
  const auto first = number(value);
  if (!first || !value.starts_with('-')) return;
  value.remove_prefix(1);
  const auto last = number(value);
  if (!last || !value.starts_with('/')) return;
  value.remove_prefix(1);
  const auto total = number(value);
  if (!total || !value.empty() || *last < *first || *last >= *total) return;
  answer.first = first;
  answer.last = last;
  answer.total = total;
}

std::size_t take_header(char* data, std::size_t size, std::size_t count, void* user) {
  auto& transfer = *static_cast<Transfer*>(user);
  const std::string_view line(data, size * count);
  std::string_view value;
  if (line.starts_with("HTTP/")) {  // of another answer after a redirect
    transfer.answer.etag.clear();
    transfer.answer.first = transfer.answer.last = transfer.answer.total = std::nullopt;
  } else if (starts_with_name(line, "content-range", value)) {
    read_content_range(value, transfer.answer);
  } else if (starts_with_name(line, "etag", value) && value.starts_with('"')) {
    transfer.answer.etag = std::string(value.substr(0, 200));
  }
  return size * count;
}

std::size_t take_body(char* data, std::size_t size, std::size_t count, void* user) {
  auto& transfer = *static_cast<Transfer*>(user);
  long status = 0;
  ::curl_easy_getinfo(transfer.handle, CURLINFO_RESPONSE_CODE, &status);
  if (status != 200 && status != 206) return size * count;  // an error page
  if (transfer.wants_range && status == 200) {
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

}  // namespace

std::string shown_url(const std::string& url) {
  const std::size_t scheme = url.find("://");
  if (scheme == std::string::npos) return url;
  const std::size_t host = scheme + 3, path = std::min(url.find('/', host), url.size());
  const std::size_t at = url.rfind('@', path);
  return at == std::string::npos || at < host ? url : url.substr(0, host) + url.substr(at + 1);
}

bool is_url(const std::string& text) { return text.starts_with("http://") || text.starts_with("https://"); }

namespace {

void start_curl() {
  static std::once_flag once;
  std::call_once(once, [] { ::curl_global_init(CURL_GLOBAL_DEFAULT); });
}

/// Sets the handle up for a GET; the headers belong to the caller and must live as long as the transfer.
curl_slist* prepare(CURL* h, Transfer& transfer, const std::string& url,
                    const std::optional<HttpRange>& range, const std::string& if_range_etag,
                    const HttpOptions& options) {
  ::curl_easy_setopt(h, CURLOPT_URL, url.c_str());
  ::curl_easy_setopt(h, CURLOPT_PROTOCOLS_STR, "http,https");
  ::curl_easy_setopt(h, CURLOPT_REDIR_PROTOCOLS_STR, "http,https");
  ::curl_easy_setopt(h, CURLOPT_FOLLOWLOCATION, 1L);
  ::curl_easy_setopt(h, CURLOPT_MAXREDIRS, kMaxRedirects);
  ::curl_easy_setopt(h, CURLOPT_NOSIGNAL, 1L);
  ::curl_easy_setopt(h, CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(options.connect_timeout_s * 1000));
  ::curl_easy_setopt(h, CURLOPT_LOW_SPEED_LIMIT, 1L);
  ::curl_easy_setopt(h, CURLOPT_LOW_SPEED_TIME, std::max(1L, static_cast<long>(options.stall_timeout_s)));
  ::curl_easy_setopt(h, CURLOPT_USERAGENT, "texmesh");
  ::curl_easy_setopt(h, CURLOPT_HEADERFUNCTION, take_header);
  ::curl_easy_setopt(h, CURLOPT_HEADERDATA, &transfer);
  ::curl_easy_setopt(h, CURLOPT_WRITEFUNCTION, take_body);
  ::curl_easy_setopt(h, CURLOPT_WRITEDATA, &transfer);
  // Ranges are of the bytes as stored.
  curl_slist* headers = ::curl_slist_append(nullptr, "Accept-Encoding: identity");
  if (range) {
    const std::string asked = "Range: bytes=" + std::to_string(range->first) + "-" +
                              std::to_string(range->first + range->bytes - 1);
    headers = ::curl_slist_append(headers, asked.c_str());
    if (!if_range_etag.empty())
      headers = ::curl_slist_append(headers, ("If-Range: " + if_range_etag).c_str());
  }
  ::curl_easy_setopt(h, CURLOPT_HTTPHEADER, headers);
  return headers;
}

void conclude(Transfer& transfer, CURLcode rc) {
  ::curl_easy_getinfo(transfer.handle, CURLINFO_RESPONSE_CODE, &transfer.answer.status);
  transfer.answer.complete = rc == CURLE_OK;
  if (rc != CURLE_OK) transfer.answer.problem = ::curl_easy_strerror(rc);
}

}  // namespace

struct HttpClient::Handle {
  CURL* curl = nullptr;
  ~Handle() { ::curl_easy_cleanup(curl); }
};

HttpClient::HttpClient(const HttpOptions& options) : handle_(std::make_unique<Handle>()), options_(options) {
  start_curl();
  handle_->curl = ::curl_easy_init();
}
HttpClient::~HttpClient() = default;

HttpAnswer HttpClient::get(const std::string& url, const std::optional<Range>& range,
                           const std::string& if_range_etag, std::uint64_t max_bytes) {
  CURL* h = handle_->curl;
  ::curl_easy_reset(h);  // keeps the connection
  Transfer transfer{h, {}, max_bytes, range.has_value()};
  curl_slist* headers = prepare(h, transfer, url, range, if_range_etag, options_);
  const CURLcode rc = ::curl_easy_perform(h);
  ::curl_slist_free_all(headers);
  conclude(transfer, rc);
  return std::move(transfer.answer);
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
  start_curl();
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
  running->transfer = {::curl_easy_init(), {}, max_bytes, range.has_value()};
  running->headers = prepare(running->transfer.handle, running->transfer, url, range, "", state_->options);
  ::curl_multi_add_handle(state_->multi, running->transfer.handle);
  state_->running[number] = std::move(running);
}

void HttpPool::cancel(std::uint64_t number) { state_->drop(number); }
bool HttpPool::idle() const { return state_->running.empty(); }

std::optional<HttpPool::Ended> HttpPool::wait(double seconds) {
  const auto start = std::chrono::steady_clock::now();
  for (;;) {
    int active = 0;
    ::curl_multi_perform(state_->multi, &active);
    if (auto ended = state_->ended()) return ended;
    const std::chrono::duration<double> gone = std::chrono::steady_clock::now() - start;
    const double left_ms = 1000 * (seconds - gone.count());
    if (left_ms <= 0 || idle()) return std::nullopt;
    ::curl_multi_poll(state_->multi, nullptr, 0, static_cast<int>(std::clamp(left_ms, 1.0, 1000.0)), nullptr);
  }
}

}  // namespace texmesh
