#include "pipeline/io/names/similar_names.h"

#include <dirent.h>
#include <fcntl.h>

#include <memory>

#include "format/base/text_bytes.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

/// Bounds for a folder that somebody made to take time.
constexpr std::size_t kMostEntries = 1'000'000, kMostSimilar = 16;

/// Walks down from one folder. Depth is bounded by the parts of a name, width by kMostSimilar.
class Search {
 public:
  void look(int folder, const std::string& before, std::string_view rest) {
    const std::size_t slash = rest.find('/');
    const std::string part(rest.substr(0, slash));
    if (slash == std::string_view::npos) {
      for (const std::string& entry : entries_like(folder, part)) add(before + entry);
      return;
    }
    const auto go_on = [&](const std::string& entry) {
      const Descriptor next(::openat(folder, entry.c_str(), kFolder));
      if (next.get() >= 0) look(next.get(), before + entry + "/", rest.substr(slash + 1));
      return next.get() >= 0;
    };
    if (go_on(part)) return;
    for (const std::string& entry : entries_like(folder, part)) {
      found_.folder = {};
      listed_ = 2;
      go_on(entry);
    }
  }
  SimilarNames take() {
    std::sort(found_.names.begin(), found_.names.end());
    return std::move(found_);
  }
  static constexpr int kFolder = O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC;

 private:
  void add(std::string name) {
    if (found_.names.size() < kMostSimilar) found_.names.push_back(std::move(name));
  }
  /// Entries of the same key, without `part` itself.
  std::vector<std::string> entries_like(int folder, const std::string& part) {
    std::vector<std::string> like;
    struct stat s {};
    Descriptor own(::openat(folder, ".", kFolder));
    if (own.get() < 0 || ::fstat(own.get(), &s) != 0) return like;
    found_.folder = listed_++ == 0 ? stamp_of(s) : FileStamp{};
    const std::string key = similar_key(part);
    const std::unique_ptr<DIR, int (*)(DIR*)> listing(::fdopendir(own.get()), ::closedir);
    if (!listing) return like;
    own.release();
    for (std::size_t n = 0; n < kMostEntries; ++n) {
      const dirent* entry = ::readdir(listing.get());
      if (entry == nullptr) break;
      if (entry->d_name != part && similar_key(entry->d_name) == key) like.emplace_back(entry->d_name);
    }
    std::sort(like.begin(), like.end());
    if (like.size() > kMostSimilar) like.resize(kMostSimilar);
    return like;
  }
  SimilarNames found_;
  int listed_ = 0;
};

}  // namespace

FileRequest SimilarNames::request(const std::string& name) const {
  std::string list;
  for (const std::string& n : names) list += n + '\n';
  return {name, !names.empty(), sha256(text_bytes(list)), names.size(), folder, true};
}

SimilarNames similar_names(const std::string& folder, const std::string& name) {
  Search search;
  const Descriptor top(::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (top.get() >= 0) search.look(top.get(), "", name);
  return search.take();
}

}  // namespace texmesh
