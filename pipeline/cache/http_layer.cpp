#include <curl/curl.h>

#include <algorithm>
#include <mutex>

#include "delivery/cpp/http/http_client.h"
#include "pipeline/cache/cache_layer.h"

namespace texmesh {
namespace {

struct Sink {
  Bytes bytes;
  std::uint64_t max_bytes = 0;
};
struct Upload {
  ByteSpan rest;
};

std::size_t receive_body(char* data, std::size_t size, std::size_t count, void* user) {
  auto& sink = *static_cast<Sink*>(user);
  if (sink.bytes.size() + size * count > sink.max_bytes)
    return 0;  // ends the transfer: longer than what was asked for
  sink.bytes.insert(sink.bytes.end(), data, data + size * count);
  return size * count;
}
std::size_t ignore(char*, std::size_t size, std::size_t count, void*) { return size * count; }
std::size_t send_body(char* data, std::size_t size, std::size_t count, void* user) {
  auto& upload = *static_cast<Upload*>(user);
  const std::size_t n = std::min(size * count, upload.rest.size());
  if (n > 0) std::memcpy(data, upload.rest.data(), n);
  upload.rest = upload.rest.subspan(n);
  return n;
}

/// Ends a transfer that takes longer than the layer's patience.
struct Watch {
  const LayerPatience& patience;
  double left_s;  // of the time of all transfers
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
};
int look_at_watch(void* user, curl_off_t, curl_off_t down, curl_off_t, curl_off_t up) {
  const auto& watch = *static_cast<const Watch*>(user);
  const double s = watch.seconds(), bytes = static_cast<double>(down) + static_cast<double>(up);
  return s > watch.left_s || s > watch.patience.answer_s + bytes / LayerPatience::kBytesPerSecond;
}

struct Easy {
  CURL* handle = ::curl_easy_init();
  /// None of "Expect: 100-continue": curl would wait a second for servers that do not answer it, at each PUT.
  curl_slist* headers = ::curl_slist_append(nullptr, "Expect:");
  ~Easy() {
    ::curl_easy_cleanup(handle);
    ::curl_slist_free_all(headers);
  }
};

class HttpLayer : public CacheLayer {
 public:
  HttpLayer(std::string url, const LayerPatience& patience, const LayerClock& clock)
      : url_(std::move(url)), patience_(patience), rest_(clock) {
    while (url_.ends_with('/')) url_.pop_back();
    static std::once_flag once;
    std::call_once(once, [] { ::curl_global_init(CURL_GLOBAL_DEFAULT); });
  }
  std::string name() const override { return shown_url(url_); }

  std::optional<Bytes> get(const char* kind, const Sha256& digest, std::uint64_t max_bytes) override {
    const std::lock_guard lock(mutex_);
    Sink sink{{}, max_bytes};
    prepare(kind, digest);
    ::curl_easy_setopt(easy_.handle, CURLOPT_HTTPGET, 1L);
    ::curl_easy_setopt(easy_.handle, CURLOPT_WRITEFUNCTION, receive_body);
    ::curl_easy_setopt(easy_.handle, CURLOPT_WRITEDATA, &sink);
    const CURLcode rc = perform();
    const long status = status_code();
    if (rc != CURLE_ABORTED_BY_CALLBACK && (status == 404 || status == 410)) return std::nullopt;
    if (rc == CURLE_WRITE_ERROR && status == 200) return std::nullopt;  // too long: not what was asked for
    if (rc != CURLE_OK) fail(why(rc));
    if (status != 200) fail("status " + std::to_string(status));
    return std::move(sink.bytes);
  }

  /// A server that knows no HEAD, or tells no length, costs a PUT more.
  bool has(const char* kind, const Sha256& digest, std::uint64_t bytes) override {
    const std::lock_guard lock(mutex_);
    prepare(kind, digest);
    ::curl_easy_setopt(easy_.handle, CURLOPT_NOBODY, 1L);
    const CURLcode rc = perform();
    if (rc != CURLE_OK) fail(why(rc));
    curl_off_t length = -1;
    ::curl_easy_getinfo(easy_.handle, CURLINFO_CONTENT_LENGTH_DOWNLOAD_T, &length);
    return status_code() == 200 && length >= 0 && static_cast<std::uint64_t>(length) == bytes;
  }

  void put(const char* kind, const Sha256& digest, ByteSpan bytes) override {
    const std::lock_guard lock(mutex_);
    Upload upload{bytes};
    prepare(kind, digest);
    ::curl_easy_setopt(easy_.handle, CURLOPT_UPLOAD, 1L);
    ::curl_easy_setopt(easy_.handle, CURLOPT_HTTPHEADER, easy_.headers);
    ::curl_easy_setopt(easy_.handle, CURLOPT_READFUNCTION, send_body);
    ::curl_easy_setopt(easy_.handle, CURLOPT_READDATA, &upload);
    ::curl_easy_setopt(easy_.handle, CURLOPT_INFILESIZE_LARGE, static_cast<curl_off_t>(bytes.size()));
    ::curl_easy_setopt(easy_.handle, CURLOPT_WRITEFUNCTION, ignore);
    const CURLcode rc = perform();
    if (rc != CURLE_OK) fail(why(rc));
    if (const long status = status_code(); status < 200 || status > 299)
      throw LayerRefusal("status " + std::to_string(status) + " for a PUT");
  }

 private:
  void prepare(const char* kind, const Sha256& digest) {
    if (rest_.holds()) throw LayerError(problem_);  // another thread has waited for it already
    const bool blob = std::string_view(kind) == "cas";
    const std::string url = url_ + (blob ? "/cas/" : "/ac/") + to_hex(digest);
    CURL* h = easy_.handle;
    ::curl_easy_reset(h);  // keeps the connection
    ::curl_easy_setopt(h, CURLOPT_URL, url.c_str());
    ::curl_easy_setopt(h, CURLOPT_PROTOCOLS_STR, "http,https");
    ::curl_easy_setopt(h, CURLOPT_FOLLOWLOCATION, 0L);
    ::curl_easy_setopt(h, CURLOPT_NOSIGNAL, 1L);
    ::curl_easy_setopt(h, CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(1000 * patience_.answer_s / 2) + 1);
    ::curl_easy_setopt(h, CURLOPT_USERAGENT, "texmesh");
    ::curl_easy_setopt(h, CURLOPT_NOPROGRESS, 0L);
    ::curl_easy_setopt(h, CURLOPT_XFERINFOFUNCTION, look_at_watch);
  }

  CURLcode perform() {
    Watch watch{patience_, patience_.all_transfers_s - spent_s_};
    ::curl_easy_setopt(easy_.handle, CURLOPT_XFERINFODATA, &watch);
    const CURLcode rc = ::curl_easy_perform(easy_.handle);
    spent_s_ += watch.seconds();
    return rc;
  }

  static std::string why(CURLcode rc) {
    return rc == CURLE_ABORTED_BY_CALLBACK ? "too slow" : ::curl_easy_strerror(rc);
  }

  [[noreturn]] void fail(const std::string& problem) {
    problem_ = problem;
    rest_.begin();
    throw LayerError(problem);
  }

  long status_code() const {
    long status = 0;
    ::curl_easy_getinfo(easy_.handle, CURLINFO_RESPONSE_CODE, &status);
    return status;
  }

  std::string url_, problem_;
  LayerPatience patience_;
  LayerRest rest_;
  double spent_s_ = 0;
  std::mutex mutex_;  // one connection
  Easy easy_;
};

}  // namespace

std::unique_ptr<CacheLayer> open_http_layer(const std::string& url, const LayerPatience& patience,
                                            const LayerClock& clock) {
  check_layer(url);
  return std::make_unique<HttpLayer>(url, patience, clock);
}

}  // namespace texmesh
