#include "delivery/cpp/http_store.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <thread>

namespace texmesh {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// The server answers whole files only.
struct NoRanges {};

bool may_retry(const HttpAnswer& a) {
  return a.status == 0 || a.status == 408 || a.status == 429 || a.status >= 500 ||
         ((a.status == 200 || a.status == 206) && !a.complete && !a.too_long);
}

std::string what_came(const HttpAnswer& a) {
  if (a.status == 0 || !a.problem.empty()) return a.problem.empty() ? "no answer" : a.problem;
  return "status " + std::to_string(a.status);
}

/// Waits longer from try to try; false when there have been enough.
class Retries {
 public:
  explicit Retries(const HttpOptions& options) : left_(options.retries), delay_s_(options.retry_delay_s) {}
  bool wait() {
    if (left_-- <= 0) return false;
    std::this_thread::sleep_for(std::chrono::duration<double>(delay_s_));
    delay_s_ *= 2;
    return true;
  }

 private:
  int left_;
  double delay_s_;
};

class HttpSource final : public ByteSource {
 public:
  HttpSource(std::string url, std::shared_ptr<HttpClient> client, const HttpOptions& options)
      : url_(std::move(url)), client_(std::move(client)), options_(options) {}
  std::string name() const override { return shown_url(url_); }

  std::uint64_t size() override {
    if (!total_) keep(0, fetch(0, kBootstrapBytes));
    return *total_;
  }

  Bytes read(std::uint64_t offset, std::uint64_t bytes) override {
    if (bytes == 0) return {};
    if (offset > size() || bytes > *total_ - offset)
      throw FormatError(name(), "byte " + std::to_string(offset), std::to_string(bytes) + " bytes",
                        "a file of " + std::to_string(*total_) + " bytes");
    for (std::uint64_t at = offset; at < offset + bytes;) {
      const auto [known_end, next_begin] = known_from(at);
      if (known_end > at) {
        at = known_end;
        continue;
      }
      const std::uint64_t end = std::min(offset + bytes, next_begin);
      keep(at, fetch(at, end - at));
      at = end;
    }
    return copy(offset, bytes);
  }

 private:
  /// Where what is known at `at` ends (`at` itself when nothing is), and where the next known part begins.
  std::pair<std::uint64_t, std::uint64_t> known_from(std::uint64_t at) const {
    auto next = parts_.upper_bound(at);
    const std::uint64_t next_begin = next == parts_.end() ? ~0ull : next->first;
    if (next == parts_.begin()) return {at, next_begin};
    const auto& [begin, part] = *std::prev(next);
    return {std::max(at, begin + part.size()), next_begin};
  }
  void keep(std::uint64_t begin, Bytes bytes) {
    if (!bytes.empty()) parts_.emplace(begin, std::move(bytes));
  }
  Bytes copy(std::uint64_t offset, std::uint64_t bytes) const {
    Bytes out;
    out.reserve(static_cast<std::size_t>(bytes));
    for (std::uint64_t at = offset; at < offset + bytes;) {
      const auto& [begin, part] = *std::prev(parts_.upper_bound(at));
      const std::uint64_t n = std::min<std::uint64_t>(begin + part.size(), offset + bytes) - at;
      const auto from = part.begin() + static_cast<std::ptrdiff_t>(at - begin);
      out.insert(out.end(), from, from + static_cast<std::ptrdiff_t>(n));
      at += n;
    }
    return out;
  }

  Bytes fetch(std::uint64_t offset, std::uint64_t bytes) {
    Bytes got;
    Retries retries(options_);
    for (;;) {
      HttpAnswer a = client_->get(url_, HttpClient::Range{offset + got.size(), bytes - got.size()}, etag_,
                                  bytes - got.size());
      if (a.status == 206) check_range(a, offset + got.size(), bytes - got.size());
      if (a.status == 206) got.insert(got.end(), a.body.begin(), a.body.end());
      if (a.status == 206 && a.complete) {
        const std::uint64_t wanted = std::min(bytes, *total_ - offset);
        if (got.size() == wanted) return got;
        throw FormatError(name(), "byte " + std::to_string(offset), std::to_string(wanted) + " bytes",
                          std::to_string(got.size()));
      }
      if (a.status == 200) refuse_whole_file();
      if (a.status == 416)
        throw FormatError(name(), "byte " + std::to_string(offset), "a longer file", "status 416");
      if (a.too_long)
        throw FormatError(name(), "byte " + std::to_string(offset), std::to_string(bytes) + " bytes", "more");
      if (!may_retry(a) || !retries.wait())
        throw InputError(name(), "byte " + std::to_string(offset + got.size()), "an answer with status 206",
                         what_came(a));
    }
  }

  void refuse_whole_file() const {
    if (!total_) throw NoRanges{};
    throw FormatError(name(), "", "the file that reading began with",
                      "status 200: it was replaced, or the server no longer answers ranges");
  }

  void check_range(const HttpAnswer& a, std::uint64_t offset, std::uint64_t bytes) {
    const std::string place = "byte " + std::to_string(offset);
    if (!a.first) throw FormatError(name(), place, "a Content-Range", "none that can be read");
    if (total_ && *a.total != *total_)
      throw FormatError(name(), place, "a file of " + std::to_string(*total_) + " bytes",
                        std::to_string(*a.total));
    if (!etag_.empty() && !a.etag.empty() && a.etag != etag_)
      throw FormatError(name(), place, "the file that reading began with", "another one (ETag)");
    if (*a.first != offset || *a.last != std::min(offset + bytes, *a.total) - 1)
      throw FormatError(name(), place, "the range that was asked for",
                        std::to_string(*a.first) + "-" + std::to_string(*a.last));
    if (!total_) {
      total_ = a.total;
      etag_ = a.etag;
    }
  }

  std::string url_;
  std::shared_ptr<HttpClient> client_;
  HttpOptions options_;
  std::optional<std::uint64_t> total_;
  std::string etag_;
  std::map<std::uint64_t, Bytes> parts_;  // by offset, not overlapping
};

/// Whole files of the tree beside the container, or that `unpack` made: for servers without ranges.
class HttpTree final : public PackageStore {
 public:
  HttpTree(std::string root, std::shared_ptr<HttpClient> client, const HttpOptions& options)
      : root_(std::move(root)), client_(std::move(client)), options_(options) {}
  std::string name() const override { return shown_url(root_); }
  bool is_folder() const override { return true; }

  Bytes read_manifest() override { return file(kManifestPath, kBootstrapBytes); }

  Bytes read(const EntryRef& entry, std::uint64_t offset, std::uint64_t bytes) override {
    if (offset > entry.bytes || bytes > entry.bytes - offset)
      throw FormatError(name(), "entry " + entry.path,
                        std::to_string(bytes) + " bytes from " + std::to_string(offset),
                        "an entry of " + std::to_string(entry.bytes) + " bytes");
    const Bytes& whole = file(entry.path, entry.bytes);
    if (whole.size() != entry.bytes)
      throw FormatError(name(), entry.path, std::to_string(entry.bytes) + " bytes",
                        std::to_string(whole.size()));
    const auto from = whole.begin() + static_cast<std::ptrdiff_t>(offset);
    return {from, from + static_cast<std::ptrdiff_t>(bytes)};
  }

  std::vector<ContainerEntry> list() override {
    throw InputError(name(), "", "a store that can be listed", "files of a web server");
  }

 private:
  const Bytes& file(const std::string& path, std::uint64_t max_bytes) {
    if (const auto it = files_.find(path); it != files_.end()) return it->second;
    if (!is_valid_entry_path(path)) throw FormatError(name(), path, "a path within the package", "another");
    Retries retries(options_);
    for (;;) {
      HttpAnswer a = client_->get(root_ + path, std::nullopt, "", max_bytes);
      if (a.status == 200 && a.complete) return files_[path] = std::move(a.body);
      if (a.too_long)
        throw FormatError(name(), path, "at most " + std::to_string(max_bytes) + " bytes", "more");
      if (!may_retry(a) || !retries.wait()) throw InputError(name() + path, "", "a file", what_came(a));
    }
  }

  std::string root_;
  std::shared_ptr<HttpClient> client_;
  HttpOptions options_;
  std::map<std::string, Bytes> files_;
};

/// Finds out how the server can be read when the manifest is asked for.
class HttpStore final : public PackageStore {
 public:
  HttpStore(std::string url, const HttpOptions& options)
      : url_(std::move(url)), options_(options), client_(std::make_shared<HttpClient>(options)) {}
  std::string name() const override { return inner_ ? inner_->name() : shown_url(url_); }
  bool is_folder() const override { return inner_ && inner_->is_folder(); }
  Bytes read_manifest() override {
    if (inner_) return inner_->read_manifest();
    // The URL of a tree ends in a slash.
    if (url_.substr(0, url_.find_first_of("?#")).ends_with('/')) return use(tree(url_));
    try {
      return use(open_container(std::make_unique<HttpSource>(url_, client_, options_)));
    } catch (const NoRanges&) {
    }
    if (const std::string root = tree_url(); !root.empty()) {
      try {
        return use(tree(root));
      } catch (const InputError&) {  // none there
      }
    }
    return use(open_container(memory_source(whole_file(), shown_url(url_))));
  }
  Bytes read(const EntryRef& entry, std::uint64_t offset, std::uint64_t bytes) override {
    return opened().read(entry, offset, bytes);
  }
  std::vector<ContainerEntry> list() override { return opened().list(); }

 private:
  PackageStore& opened() {
    if (!inner_) read_manifest();
    return *inner_;
  }
  std::unique_ptr<PackageStore> tree(const std::string& root) const {
    return std::make_unique<HttpTree>(root, client_, options_);
  }
  Bytes use(std::unique_ptr<PackageStore> store) {
    Bytes manifest = store->read_manifest();
    inner_ = std::move(store);
    return manifest;
  }
  /// https://host/a/NAME.texmesh -> https://host/a/NAME/
  std::string tree_url() const {
    const std::string path = url_.substr(0, url_.find_first_of("?#"));
    constexpr std::string_view kExtension = ".texmesh";
    return path.ends_with(kExtension) ? path.substr(0, path.size() - kExtension.size()) + "/" : "";
  }
  Bytes whole_file() {
    Retries retries(options_);
    for (;;) {
      HttpAnswer a = client_->get(url_, std::nullopt, "", options_.max_whole_bytes);
      if (a.status == 200 && a.complete) return std::move(a.body);
      if (a.too_long)
        throw InputError(
            shown_url(url_), "",
            "at most " + std::to_string(options_.max_whole_bytes) + " bytes from a server without ranges",
            "more");
      if (!may_retry(a) || !retries.wait())
        throw InputError(shown_url(url_), "", "an answer with status 200", what_came(a));
    }
  }

  std::string url_;
  HttpOptions options_;
  std::shared_ptr<HttpClient> client_;
  std::unique_ptr<PackageStore> inner_;
};

}  // namespace

std::unique_ptr<PackageStore> open_url(const std::string& url, const HttpOptions& options) {
  if (!is_url(url)) throw InputError(url, "", "an http or https URL", "another text");
  return std::make_unique<HttpStore>(url, options);
}

}  // namespace texmesh
