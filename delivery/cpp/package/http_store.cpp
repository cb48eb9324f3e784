#include "delivery/cpp/package/http_store.h"

#include <algorithm>

#include "delivery/cpp/package/http_source.h"
#include "delivery/cpp/package/http_tree.h"
#include "format/base/errors.h"
#include "format/container/layout.h"
#include "format/documents/manifest.h"

namespace texmesh {
namespace {

constexpr double kHeadStart_s = 0.5;  // of a mirror before the next is asked

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
      : urls_(std::move(urls)), link_(std::make_shared<HttpLink>(options)), refused_(urls_.size(), false) {}
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
      FirstAnswer first = first_answer();
      place_.mirror = first.mirror;
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
      throw FormatError(name(), entry.path, std::to_string(entry.bytes) + " bytes",
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
  struct FirstAnswer {
    std::size_t mirror = 0;
    HttpAnswer answer;
  };
  /// The first that answers with the beginning of a package, or says that it knows no ranges.
  FirstAnswer first_answer() {
    HttpRetries retries(link_->options);
    for (;;) {
      std::vector<std::size_t> order;
      for (std::size_t m = 0; m < urls_.size(); ++m)
        if (!refused_[m]) order.push_back(m);
      HttpAnswer last;
      std::size_t started = 0, ended_count = 0;
      const auto start_next = [&] { ask_first(order[started++]); };
      for (start_next(); ended_count < order.size();) {
        auto ended = link_->pool.wait(started < order.size() ? kHeadStart_s : kRequestWait_s);
        if (!ended) {
          if (started == order.size() && link_->pool.idle()) break;
          if (started < order.size()) start_next();
          continue;
        }
        HttpAnswer& a = ended->answer;
        const bool whole = a.status == 200 && (a.complete || a.too_long);
        const bool cut =
            !a.too_long && !a.body.empty() && !is_tree(urls_[static_cast<std::size_t>(ended->number)]);
        if (whole || (a.status == 206 && (a.complete || cut))) {
          for (const std::size_t m : order) link_->pool.cancel(m);
          return {static_cast<std::size_t>(ended->number), std::move(a)};
        }
        ++ended_count;
        if (!may_retry(a)) refused_[static_cast<std::size_t>(ended->number)] = true;
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
    link_->pool.start(mirror, tree ? urls_[mirror] + kManifestPath : urls_[mirror],
                      HttpRange{0, first_bytes(tree), tree}, first_bytes(tree));
  }
  [[noreturn]] void throw_problem(const HttpAnswer& a) const {
    std::string names = shown_url(urls_.front());
    for (std::size_t m = 1; m < urls_.size(); ++m) names += ", " + shown_url(urls_[m]);
    if (a.too_long)
      throw FormatError(names, "byte 0", "at most " + std::to_string(kStartBytes) + " bytes", "more");
    if (a.status == 416) throw FormatError(names, "byte 0", "a longer file", "status 416");
    throw InputError(names, "byte 0", "an answer with status 206", describe_answer(a));
  }

  Bytes open_by(FirstAnswer first) {
    const std::string& url = urls_[first.mirror];
    if (is_tree(url)) {
      if (first.answer.too_long)
        throw FormatError(shown_url(url), kManifestPath,
                          "at most " + std::to_string(kBootstrapBytes) + " bytes", "more");
      return open_tree(url, std::move(first.answer));
    }
    if (first.answer.status == 206) return open_ranges(first.mirror, std::move(first.answer));
    if (const std::string root = tree_beside(url); !root.empty()) {
      link_->pool.start(0, root + kManifestPath, HttpRange{0, kBootstrapBytes, true}, kBootstrapBytes);
      const auto ended = link_->pool.wait(kRequestWait_s);
      if (ended && ended->answer.complete && (ended->answer.status == 200 || ended->answer.status == 206))
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
    if (place_.ranges && (!manifest.first || *manifest.first != 0 || *manifest.last + 1 != *manifest.total))
      throw FormatError(shown_url(root), kManifestPath, "the range that was asked for", "another");
    tree_ = std::make_unique<HttpTree>(root, link_, place_.ranges);
    tree_->store(kManifestPath, manifest.body);
    return std::move(manifest.body);
  }
  /// After ranges have ended: the tree beside the container, where it is the same package.
  bool take_tree() {
    const std::string root = tree_beside(place_.url);
    if (root.empty()) return false;
    const Bytes known = container_->read_manifest();
    link_->pool.start(0, root + kManifestPath, std::nullopt, kBootstrapBytes);
    auto ended = link_->pool.wait(kRequestWait_s);
    if (!ended || !ended->answer.complete || ended->answer.status != 200) return false;
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
    auto source = std::make_unique<HttpSource>(std::move(urls), link_, std::move(first));
    source_ = source.get();
    place_.url = urls_[mirror];
    container_ = open_container(std::move(source));
    return container_->read_manifest();
  }
  Bytes whole_file(const std::string& url) {
    HttpRetries retries(link_->options);
    for (;;) {
      link_->pool.start(0, url, std::nullopt, link_->options.max_whole_bytes);
      auto ended = link_->pool.wait(kRequestWait_s);
      HttpAnswer a = ended ? std::move(ended->answer) : HttpAnswer{};
      if (a.status == 200 && a.complete) {
        // The answer before was broken off, and says nothing of the link.
        place_.bytes_s = static_cast<double>(a.body.size()) / std::max(1e-6, a.received_s);
        return std::move(a.body);
      }
      if (a.too_long)
        throw InputError(shown_url(url), "",
                         "at most " + std::to_string(link_->options.max_whole_bytes) +
                             " bytes from a server without ranges",
                         "more");
      if (!may_retry(a) || !retries.wait(a))
        throw InputError(shown_url(url), "", "an answer with status 200", describe_answer(a));
    }
  }

  std::vector<std::string> urls_;
  std::shared_ptr<HttpLink> link_;
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

std::unique_ptr<PackageStore> open_url(const std::string& url, const HttpOptions& options) {
  return open_urls({url}, options);
}

}  // namespace texmesh
