#include "delivery/cpp/package/http_store.h"

#include <chrono>
#include <thread>

// How a package is read from web servers, from the bottom up. All readers of a package share the connections
// of one HttpPool. HttpRetries counts the tries of a request. HttpSource reads ranges of a container,
// HttpTree whole files of a tree. UrlStore finds out which of these the servers can serve, and changes from
// the one to the other when a server stops answering ranges.
namespace texmesh {
namespace {

/// Another answer than the expected one; none at all is what the system says of it.
[[noreturn]] void fail_answer(const std::string& file, const std::string& place, const std::string& expected,
                              const HttpAnswer& a) {
  if (a.status == 0) throw InputError(file, "", "", "cannot be read: " + describe_answer(a));
  throw InputError(file, place, expected, describe_answer(a));
}

constexpr int kConnections = 6;  // as browsers have
constexpr int kStallTries = 2;   // what a try costs that ended with silence
constexpr double kSlice_s = 0.1;
constexpr std::uint64_t kJoinBytes = 4096;      // ranges so near to each other are one request
constexpr double kHeadStart_s = 0.5;            // of a mirror before the next is asked
constexpr double kRequestWait_s = 3600;         // the pool's own limits end requests sooner
constexpr std::uint64_t kProgressBytes = 1024;  // a try that brings as many is not counted

/// Counts the tries of one request and waits longer from one to the next.
class HttpRetries {
 public:
  explicit HttpRetries(const HttpOptions& options)
      : options_(options), left_(options.retries), delay_s_(options.retry_delay_s) {}
  /// Waits before the next try; false when there have been enough.
  bool wait(const HttpAnswer& last) {
    left_ -= last.timed_out ? kStallTries : 1;
    if (left_ < 0) return false;
    double s = std::min(std::max(delay_s_, last.retry_after_s), options_.most_retry_delay_s);
    for (; s > 0; s -= kSlice_s) {
      if (options_.cancelled && options_.cancelled()) return false;
      std::this_thread::sleep_for(std::chrono::duration<double>(std::min(s, kSlice_s)));
    }
    delay_s_ *= 2;
    return true;
  }

 private:
  HttpOptions options_;
  int left_;
  double delay_s_;
};

/// A server that has answered ranges answers 200 for one, and the file is still the same.
class RangesEnded : public InputError {
 public:
  using InputError::InputError;
};

/// Throws where what came is not the file's bytes but a page for people, or bytes that a server has
/// compressed.
void require_file(const HttpAnswer& a, ByteSpan body, const std::string& url) {
  if (is_page(a, body))
    throw FormatError(url, "", "a file of a package",
                      "a page, as of a login or of an unknown address: " + describe_answer(a));
  if (a.status == 206 && is_compressed(a))
    throw FormatError(url, "", "the bytes of the file as it is stored",
                      describe_answer(a) + ": the server must not compress files of packages");
}

/// Reads ranges of a container from the first server that delivers them.
class HttpSource final : public ByteSource {
 public:
  /// `first`: the answer of urls[0] to a request for the first kStartBytes, or a part of it.
  HttpSource(std::vector<std::string> urls, std::shared_ptr<HttpPool> pool, HttpAnswer first)
      : urls_(std::move(urls)), pool_(std::move(pool)) {
    check_range(first, 0, kStartBytes);
    require_whole(first, 0);
    store(0, std::move(first.body));
  }
  std::string name() const override { return shown_url(urls_.front()); }
  std::uint64_t size() override { return *total_; }
  const std::string& etag() const { return etag_; }

  Bytes read(std::uint64_t offset, std::uint64_t bytes) override {
    if (bytes == 0) return {};
    require(offset, bytes);
    fetch(missing(offset, bytes, {}));
    return copy(offset, bytes);
  }

  /// Fetches all of these ranges at once.
  void prefetch(std::vector<ByteRange> ranges) {
    std::ranges::sort(ranges, {}, &ByteRange::offset);
    std::vector<Piece> pieces;
    for (const ByteRange& r : ranges) {
      if (r.bytes == 0) continue;
      require(r.offset, r.bytes);
      pieces = missing(r.offset, r.bytes, std::move(pieces));
    }
    fetch(std::move(pieces));
  }

 private:
  struct Piece {
    std::uint64_t offset = 0, bytes = 0;
    Bytes got;
    std::optional<HttpRetries> retries;
  };

  void require(std::uint64_t offset, std::uint64_t bytes) const {
    if (offset > *total_ || bytes > *total_ - offset)
      throw FormatError(name(), "byte " + std::to_string(offset), std::to_string(bytes) + " bytes",
                        "a file of " + std::to_string(*total_) + " bytes");
    if (bytes > pool_->options().max_whole_bytes)
      throw InputError(name(), "byte " + std::to_string(offset),
                       "at most " + std::to_string(pool_->options().max_whole_bytes) + " bytes from a server",
                       std::to_string(bytes));
  }
  /// `pieces` with the parts of a range that are not known, behind them. Where the last piece ends near the
  /// range, that piece grows.
  std::vector<Piece> missing(std::uint64_t offset, std::uint64_t bytes, std::vector<Piece> pieces) const {
    for (std::uint64_t at = offset; at < offset + bytes;) {
      const auto [known_end, next_begin] = known_from(at);
      if (known_end > at) {
        at = known_end;
        continue;
      }
      const std::uint64_t end = std::min(offset + bytes, next_begin);
      const std::uint64_t last_end = pieces.empty() ? 0 : pieces.back().offset + pieces.back().bytes;
      if (!pieces.empty() && at <= last_end + kJoinBytes && known_from(last_end).second >= end &&
          known_from(last_end).first == last_end)
        pieces.back().bytes = std::max(last_end, end) - pieces.back().offset;
      else if (at >= last_end)
        pieces.push_back({at, end - at, {}, {}});
      at = end;
    }
    return pieces;
  }
  /// The end of the known part that holds `at` (`at` itself without such a part), and the begin of the next
  /// one.
  std::pair<std::uint64_t, std::uint64_t> known_from(std::uint64_t at) const {
    auto next = parts_.upper_bound(at);
    const std::uint64_t next_begin = next == parts_.end() ? ~0ull : next->first;
    if (next == parts_.begin()) return {at, next_begin};
    const auto& [begin, part] = *std::prev(next);
    return {std::max(at, begin + part.size()), next_begin};
  }
  void store(std::uint64_t begin, Bytes bytes) {
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

  /// Fetches the pieces. Bytes that have come are kept even when another piece fails, but none that may be
  /// another package's.
  void fetch(std::vector<Piece> pieces) {
    if (pieces.empty()) return;
    const auto store_all = [&] {
      for (Piece& p : pieces) store(p.offset, std::move(p.got));
    };
    try {
      for (std::size_t i = 0; i < pieces.size(); ++i) {
        pieces[i].retries.emplace(pool_->options());
        start(i, pieces[i]);
      }
      while (auto ended = pool_->wait(kRequestWait_s)) {
        const std::size_t asked_of = at_;
        if (accept(pieces[ended->number], ended->answer)) continue;
        if (at_ != asked_of) ask_next_server(pieces, ended->number);
        start(ended->number, pieces[ended->number]);
      }
    } catch (...) {
      for (std::size_t i = 0; i < pieces.size(); ++i) pool_->cancel(i);
      if (is_same_package()) store_all();
      throw;
    }
    require_same_start();
    store_all();
  }
  /// Whether no answer of the server that is asked may be of another package.
  bool is_same_package() const { return other_etag_.empty() || same_start_; }
  void forget_etags() {
    etag_.clear();
    other_etag_.clear();
    same_start_ = false;
  }
  /// Asks another server for what is left; for all of it where the last one may have sent another package.
  void ask_next_server(std::vector<Piece>& pieces, std::size_t failed) {
    const bool keep = is_same_package();
    forget_etags();
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      if (!keep) pieces[i].got.clear();
      if (i == failed || (keep && !pool_->so_far(i))) continue;
      pool_->cancel(i);
      start(i, pieces[i]);
    }
  }
  /// After another ETag: servers behind one name may each have their own. Throws unless the package still
  /// begins with the same bytes there.
  void require_same_start() {
    if (is_same_package()) return;
    const std::size_t asked_of = at_;
    Piece now{0, std::min(known_from(0).first, kBootstrapBytes), {}, HttpRetries(pool_->options())};
    start(0, now);
    while (auto ended = pool_->wait(kRequestWait_s)) {
      if (accept(now, ended->answer)) break;
      if (at_ != asked_of) {  // the next read asks another server
        forget_etags();
        fail_answer(name(), "byte 0", "an answer with status 206", ended->answer);
      }
      start(0, now);
    }
    if (now.got != copy(0, now.bytes)) fail_replaced("ETag " + other_etag_);
    same_start_ = true;
  }
  void start(std::size_t number, const Piece& p) {
    const std::uint64_t bytes = p.bytes - p.got.size();
    pool_->start(number, urls_[at_], HttpRange{p.offset + p.got.size(), bytes}, bytes);
  }
  /// Takes an answer. False: the piece is not complete and must be asked for again.
  bool accept(Piece& p, HttpAnswer& a) {
    const std::uint64_t at = p.offset + p.got.size();
    const std::string place = "byte " + std::to_string(at);
    if (a.status == 206 && (a.complete || !a.body.empty())) {
      check_range(a, at, p.bytes - p.got.size());
      p.got.insert(p.got.end(), a.body.begin(), a.body.end());
      if (a.body.size() >= kProgressBytes) p.retries.emplace(pool_->options());
      if (p.got.size() == p.bytes) return true;
      if (a.complete) {
        require_whole(a, at);
        if (a.body.size() >= kProgressBytes) return false;  // some servers send no more at once
        throw FormatError(name(), place, std::to_string(p.bytes) + " bytes",
                          std::to_string(p.got.size()) + ", " + describe_answer(a));
      }
    }
    if (a.too_long && a.status == 206)
      throw FormatError(name(), place, std::to_string(p.bytes) + " bytes", "more");
    if (may_retry(a) && p.retries->wait(a)) return false;
    if (at_ + 1 < urls_.size() && a.problem != "cancelled") {
      ++at_;
      p.retries.emplace(pool_->options());
      return false;
    }
    if (a.status == 200 && is_same_file(a, same_start_ ? "" : etag_, *total_))
      throw RangesEnded(name(), place, "an answer with status 206",
                        "status 200: ranges are no longer answered");
    if (a.status == 200 || a.status == 416) fail_replaced("status " + std::to_string(a.status));
    fail_answer(name(), place, "an answer with status 206", a);
  }

  [[noreturn]] void fail_replaced(const std::string& found) const {
    throw FormatError(name(), "", "the file that reading began with",
                      found + ": it was replaced, read it anew");
  }
  /// Throws where the body has not the length that its Content-Range says, as a compressed one.
  void require_whole(const HttpAnswer& a, std::uint64_t at) const {
    const std::uint64_t bytes = *a.last - *a.first + 1;
    if (a.complete && a.body.size() != bytes)
      throw FormatError(name(), "byte " + std::to_string(at), std::to_string(bytes) + " bytes",
                        std::to_string(a.body.size()) + ", " + describe_answer(a));
  }
  /// Throws where an answer is of another file, or of another place of it. It may be shorter than was asked
  /// for.
  void check_range(const HttpAnswer& a, std::uint64_t offset, std::uint64_t bytes) {
    const std::string place = "byte " + std::to_string(offset);
    require_file(a, offset == 0 ? ByteSpan(a.body) : ByteSpan(), name());
    if (!a.first)
      throw FormatError(name(), place, "a Content-Range", "none that can be read: " + describe_answer(a));
    const std::uint64_t total = a.total ? *a.total : *total_;  // the first answer has it
    if (total_ && total != *total_) fail_replaced(std::to_string(total) + " bytes");
    if (!a.etag.empty() && !etag_.empty() && a.etag != etag_) other_etag_ = a.etag;
    if (*a.first != offset || *a.last >= std::min(offset + bytes, total))
      throw FormatError(name(), place, "the range that was asked for",
                        std::to_string(*a.first) + "-" + std::to_string(*a.last));
    total_ = total;
    if (etag_.empty()) etag_ = a.etag;
  }

  std::vector<std::string> urls_;
  std::size_t at_ = 0;  // the server that is asked
  std::shared_ptr<HttpPool> pool_;
  std::optional<std::uint64_t> total_;
  std::string etag_, other_etag_;         // of the server that is asked; one that an answer had later
  bool same_start_ = false;               // and the package began as before all the same
  std::map<std::uint64_t, Bytes> parts_;  // by offset, not overlapping
};

/// Whole files of a tree, from any of its servers.
class HttpTree {
 public:
  HttpTree(std::string root, std::shared_ptr<HttpPool> pool, bool ranges)
      : root_(std::move(root)), pool_(std::move(pool)), ranges_(ranges) {}
  const std::string& root() const { return root_; }
  std::string name() const { return shown_url(root_); }
  void store(const std::string& path, Bytes bytes) { files_[path] = std::move(bytes); }

  struct Wanted {
    std::string path;
    std::uint64_t max_bytes = 0;
    Bytes got = {};  // of a transfer that broke, where the server knows ranges
    std::string etag = {};
  };
  /// Fetches the file unless it is here.
  const Bytes& file(const std::string& path, std::uint64_t max_bytes) {
    fetch({{path, max_bytes}});
    return files_[path];
  }
  /// Fetches all of these at once but those that are here.
  void fetch(std::vector<Wanted> wanted) {
    std::erase_if(wanted, [&](const Wanted& w) { return files_.contains(w.path); });
    std::vector<HttpRetries> retries(wanted.size(), HttpRetries(pool_->options()));
    try {
      for (std::size_t i = 0; i < wanted.size(); ++i) {
        if (!is_valid_entry_path(wanted[i].path))
          throw FormatError(name(), wanted[i].path, "a path within the package", "another");
        start(i, wanted[i]);
      }
      while (auto ended = pool_->wait(kRequestWait_s)) {
        const auto i = ended->number;
        HttpAnswer& a = ended->answer;
        require_file(a, wanted[i].got.empty() ? a.body : wanted[i].got, name() + wanted[i].path);
        if (accept(wanted[i], a)) {
          store(wanted[i].path, std::move(wanted[i].got));
          continue;
        }
        if (a.too_long)
          throw FormatError(name(), wanted[i].path,
                            "at most " + std::to_string(wanted[i].max_bytes) + " bytes", "more");
        if (a.body.size() >= kProgressBytes && ranges_) retries[i] = HttpRetries(pool_->options());
        if (!may_retry(a) || !retries[i].wait(a)) fail_answer(name() + wanted[i].path, "", "a file", a);
        start(i, wanted[i]);
      }
    } catch (...) {
      for (std::size_t i = 0; i < wanted.size(); ++i) pool_->cancel(i);
      throw;
    }
  }

 private:
  void start(std::size_t number, const Wanted& w) {
    const std::uint64_t have = w.got.size();
    const HttpRange rest{have, w.max_bytes - have, true};  // all of it where it was replaced
    pool_->start(number, root_ + w.path, have > 0 ? std::optional(rest) : std::nullopt, w.max_bytes);
  }
  /// Whether the file is complete now.
  bool accept(Wanted& w, HttpAnswer& a) const {
    if (a.status == 206 && !is_same_file(a, w.etag, 0)) {  // replaced meanwhile: all of it anew
      w.got.clear();
      w.etag.clear();
      a.complete = a.too_long = false;  // worth another try
      return false;
    }
    if (a.status == 200) w.got.clear();
    if (a.status != 200 && (a.status != 206 || !a.first || *a.first != w.got.size())) return false;
    w.got.insert(w.got.end(), a.body.begin(), a.body.end());
    if (a.complete) return true;
    w.etag = a.etag;
    if (!ranges_ || w.got.size() >= w.max_bytes) w.got.clear();
    return false;
  }
  std::string root_;
  std::shared_ptr<HttpPool> pool_;
  bool ranges_;
  std::map<std::string, Bytes> files_;
};

bool is_tree(const std::string& url) { return url.substr(0, url.find_first_of("?#")).ends_with('/'); }

/// https://host/a/NAME.texmesh -> https://host/a/NAME/, or nothing.
std::string tree_beside(const std::string& url) {
  const std::string path = url.substr(0, url.find_first_of("?#"));
  constexpr std::string_view kExtension = ".texmesh";
  return path.ends_with(kExtension) ? path.substr(0, path.size() - kExtension.size()) + "/" : "";
}

/// Finds out how the servers can be read when the manifest is asked for.
class UrlStore final : public HttpStore {
 public:
  UrlStore(std::vector<std::string> urls, const HttpOptions& options)
      : urls_(std::move(urls)),
        pool_(std::make_shared<HttpPool>(options, kConnections)),
        refused_(urls_.size(), false) {}
  std::string name() const override { return shown_url(place_.url.empty() ? urls_.front() : place_.url); }
  bool is_folder() const override { return tree_ != nullptr; }
  HttpPlace place() const override {
    HttpPlace place = place_;
    if (source_) place.etag = source_->etag();
    return place;
  }

  Bytes read_manifest() override {
    if (container_) return container_->read_manifest();
    if (tree_) return tree_->file(kManifestPath, kBootstrapBytes);
    for (;;) {
      HttpPool::Ended first = first_answer();
      place_.mirror = first.number;
      place_.rtt_s = first.answer.first_byte_s;
      place_.bytes_s =
          static_cast<double>(first.answer.body.size()) / std::max(1e-6, first.answer.received_s);
      try {
        Bytes manifest = open_by(std::move(first));
        if (urls_.size() > 1) texmesh::read_manifest(manifest);
        return manifest;
      } catch (const FormatError&) {  // another server may know better
        refused_[place_.mirror] = true;
        if (std::ranges::find(refused_, false) == refused_.end()) throw;
        place_ = {};
        container_.reset();
        tree_.reset();
        source_ = nullptr;
      }
    }
  }
  Bytes read(const EntryRef& entry, std::uint64_t offset, std::uint64_t bytes) override {
    if (!container_ && !tree_) read_manifest();
    if (container_) {
      try {
        return container_->read(entry, offset, bytes);
      } catch (const RangesEnded&) {
        if (!take_tree()) throw;
      }
    }
    if (offset > entry.bytes || bytes > entry.bytes - offset)
      throw FormatError(name(), "entry " + entry.path,
                        std::to_string(bytes) + " bytes from " + std::to_string(offset),
                        "an entry of " + std::to_string(entry.bytes) + " bytes");
    const Bytes& whole = tree_->file(entry.path, entry.bytes);
    if (whole.size() != entry.bytes)
      throw FormatError(name() + entry.path, "", std::to_string(entry.bytes) + " bytes",
                        std::to_string(whole.size()));
    const auto from = whole.begin() + static_cast<std::ptrdiff_t>(offset);
    return {from, from + static_cast<std::ptrdiff_t>(bytes)};
  }
  void prefetch(const std::vector<EntryRef>& entries) override {
    if (source_) {
      std::vector<ByteRange> ranges;
      for (const EntryRef& e : entries)
        if (e.bytes <= most_entry_bytes(e.path)) ranges.push_back({e.offset, e.bytes});
      try {
        source_->prefetch(std::move(ranges));
      } catch (const RangesEnded&) {
        if (!take_tree()) throw;
      }
    } else if (tree_) {
      std::vector<HttpTree::Wanted> files;
      for (const EntryRef& e : entries)
        if (e.bytes <= most_entry_bytes(e.path)) files.push_back({e.path, e.bytes});
      tree_->fetch(std::move(files));
    }
  }
  std::vector<ContainerEntry> list() override {
    if (!container_ && !tree_) read_manifest();
    if (tree_) throw InputError(name(), "", "a store that can be listed", "files of a web server");
    return container_->list();
  }

 private:
  /// The first mirror, by its number, that answers with the beginning of a package, or says that it knows no
  /// ranges.
  HttpPool::Ended first_answer() {
    HttpRetries retries(pool_->options());
    for (;;) {
      std::vector<std::size_t> order;
      for (std::size_t m = 0; m < urls_.size(); ++m)
        if (!refused_[m]) order.push_back(m);
      HttpAnswer last;
      std::size_t started = 0, ended_count = 0;
      const auto start_next = [&] { ask_first(order[started++]); };
      for (start_next(); ended_count < order.size();) {
        auto ended = pool_->wait(started < order.size() ? kHeadStart_s : kRequestWait_s);
        if (!ended) {
          if (started == order.size() && pool_->idle()) break;
          if (started < order.size()) start_next();
          continue;
        }
        HttpAnswer& a = ended->answer;
        const bool whole = a.status == 200 && (a.complete || a.too_long);
        const bool cut = !a.too_long && !a.body.empty() && !is_tree(urls_[ended->number]);
        if (whole || (a.status == 206 && (a.complete || cut))) {
          for (const std::size_t m : order) pool_->cancel(m);
          return std::move(*ended);
        }
        ++ended_count;
        if (!may_retry(a)) refused_[ended->number] = true;
        last = std::move(a);
        if (started < order.size()) start_next();
      }
      const bool none = std::ranges::find(refused_, false) == refused_.end();
      if (none || !retries.wait(last)) throw_problem(last);
    }
  }
  /// A tree's manifest is a file of its own.
  static std::uint64_t first_bytes(bool tree) { return tree ? kBootstrapBytes : kStartBytes; }
  void ask_first(std::size_t mirror) {
    const bool tree = is_tree(urls_[mirror]);
    pool_->start(mirror, tree ? urls_[mirror] + kManifestPath : urls_[mirror],
                 HttpRange{0, first_bytes(tree), tree}, first_bytes(tree));
  }
  [[noreturn]] void throw_problem(const HttpAnswer& a) const {
    std::string names = shown_url(urls_.front());
    for (std::size_t m = 1; m < urls_.size(); ++m) names += ", " + shown_url(urls_[m]);
    if (a.too_long)
      throw FormatError(names, "byte 0", "at most " + std::to_string(kStartBytes) + " bytes", "more");
    if (a.status == 416) throw FormatError(names, "byte 0", "a longer file", "status 416");
    fail_answer(names, "byte 0", "an answer with status 206", a);
  }

  Bytes open_by(HttpPool::Ended first) {
    const std::string& url = urls_[first.number];
    if (is_tree(url)) {
      require_file(first.answer, first.answer.body, shown_url(url) + kManifestPath);
      if (first.answer.too_long)
        throw FormatError(shown_url(url), kManifestPath,
                          "at most " + std::to_string(kBootstrapBytes) + " bytes", "more");
      return open_tree(url, std::move(first.answer));
    }
    if (first.answer.status == 206 && (first.answer.total || !first.answer.first))
      return open_ranges(first.number, std::move(first.answer));
    // Ranges of a file whose length the server does not tell are as good as none.
    if (const std::string root = tree_beside(url); !root.empty()) {
      pool_->start(0, root + kManifestPath, HttpRange{0, kBootstrapBytes, true}, kBootstrapBytes);
      const auto ended = pool_->wait(kRequestWait_s);
      const bool is_file = ended && ended->answer.complete && !is_page(ended->answer, ended->answer.body);
      if (is_file && (ended->answer.status == 200 || ended->answer.status == 206))
        return open_tree(root, std::move(ended->answer));
    }
    container_ = open_container(memory_source(whole_file(url), shown_url(url)));
    place_.url = url;
    place_.in_memory = true;
    return container_->read_manifest();
  }
  /// `manifest`: the answer to a request for as much of manifest.json as may be.
  Bytes open_tree(const std::string& root, HttpAnswer manifest) {
    place_.url = root;
    place_.ranges = manifest.status == 206;
    require_file(manifest, manifest.body, shown_url(root) + kManifestPath);
    const bool whole =
        manifest.first && *manifest.first == 0 &&
        (manifest.total ? *manifest.last + 1 == *manifest.total : *manifest.last + 1 < kBootstrapBytes);
    if (place_.ranges && !whole)
      throw FormatError(shown_url(root), kManifestPath, "the range that was asked for", "another");
    tree_ = std::make_unique<HttpTree>(root, pool_, place_.ranges);
    // A store may keep JSON compressed, whatever is asked for. Whole answers are decoded.
    if (is_compressed(manifest)) return tree_->file(kManifestPath, kBootstrapBytes);
    tree_->store(kManifestPath, manifest.body);
    return std::move(manifest.body);
  }
  /// After ranges have ended: the tree beside the container, where it is the same package.
  bool take_tree() {
    const std::string root = tree_beside(place_.url);
    if (root.empty()) return false;
    const Bytes known = container_->read_manifest();
    pool_->start(0, root + kManifestPath, std::nullopt, kBootstrapBytes);
    auto ended = pool_->wait(kRequestWait_s);
    if (!ended || !ended->answer.complete || ended->answer.status != 200) return false;
    if (is_page(ended->answer, ended->answer.body)) return false;
    if (ended->answer.body != known)
      throw FormatError(shown_url(root), kManifestPath, "the package that reading began with",
                        "another: it was replaced, read it anew");
    container_.reset();
    source_ = nullptr;
    open_tree(root, std::move(ended->answer));
    return true;
  }
  Bytes open_ranges(std::size_t mirror, HttpAnswer first) {
    std::vector<std::string> urls{urls_[mirror]};
    for (std::size_t m = 0; m < urls_.size(); ++m)
      if (m != mirror && !refused_[m] && !is_tree(urls_[m])) urls.push_back(urls_[m]);
    auto source = std::make_unique<HttpSource>(std::move(urls), pool_, std::move(first));
    source_ = source.get();
    place_.url = urls_[mirror];
    container_ = open_container(std::move(source));
    return container_->read_manifest();
  }
  Bytes whole_file(const std::string& url) {
    HttpRetries retries(pool_->options());
    for (;;) {
      pool_->start(0, url, std::nullopt, pool_->options().max_whole_bytes);
      auto ended = pool_->wait(kRequestWait_s);
      HttpAnswer a = ended ? std::move(ended->answer) : HttpAnswer{};
      if (a.status == 200 && a.complete) {
        require_file(a, a.body, shown_url(url));
        // The answer before was broken off, and says nothing of the link.
        place_.bytes_s = static_cast<double>(a.body.size()) / std::max(1e-6, a.received_s);
        return std::move(a.body);
      }
      if (a.too_long)
        throw InputError(shown_url(url), "",
                         "at most " + std::to_string(pool_->options().max_whole_bytes) +
                             " bytes from a server without ranges",
                         "more");
      if (!may_retry(a) || !retries.wait(a)) fail_answer(shown_url(url), "", "an answer with status 200", a);
    }
  }

  std::vector<std::string> urls_;
  std::shared_ptr<HttpPool> pool_;
  std::vector<bool> refused_;  // by mirror: never to be asked again
  HttpPlace place_;
  std::unique_ptr<PackageStore> container_;  // or
  std::unique_ptr<HttpTree> tree_;
  HttpSource* source_ = nullptr;  // of the container
};

}  // namespace

std::unique_ptr<HttpStore> open_urls(const std::vector<std::string>& urls, const HttpOptions& options) {
  if (urls.empty()) throw InputError("mirrors", "", "at least one URL", "none");
  for (const std::string& url : urls)
    if (!is_url(url)) throw InputError(url, "", "an http or https URL", "another text");
  return std::make_unique<UrlStore>(urls, options);
}

}  // namespace texmesh
