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
constexpr int kListedFolder = O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC;

/// Walks down from one folder. Depth is bounded by the parts of a name, width by kMostSimilar.
class Search {
 public:
  explicit Search(FolderLists& lists) : lists_(lists) {}
  void look(int folder, const std::string& before, std::string_view rest) {
    const std::size_t slash = rest.find('/');
    const std::string part(rest.substr(0, slash));
    if (slash == std::string_view::npos) {
      for (const std::string& entry : entries_like(folder, part)) add(before + entry);
      return;
    }
    const auto go_on = [&](const std::string& entry) {
      const Descriptor next(::openat(folder, entry.c_str(), kListedFolder));
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

 private:
  void add(std::string name) {
    if (found_.names.size() < kMostSimilar) found_.names.push_back(std::move(name));
  }
  std::vector<std::string> entries_like(int folder, const std::string& part) {
    FileStamp stamp;
    std::vector<std::string> like = lists_.entries_like(folder, part, stamp);
    if (stamp != FileStamp{}) found_.folder = listed_++ == 0 ? stamp : FileStamp{};
    return like;
  }
  FolderLists& lists_;
  SimilarNames found_;
  int listed_ = 0;
};

}  // namespace

std::vector<std::string> FolderLists::entries_like(int folder, const std::string& part, FileStamp& stamp) {
  struct stat s {};
  Descriptor own(::openat(folder, ".", kListedFolder));
  if (own.get() < 0 || ::fstat(own.get(), &s) != 0) return {};
  if (entries_ > kMostEntries) lists_.clear(), entries_ = 0;
  List& list = lists_[{s.st_dev, s.st_ino}];
  if (list.stamp != stamp_of(s)) {
    list = {};
    const std::unique_ptr<DIR, int (*)(DIR*)> listing(::fdopendir(own.get()), ::closedir);
    if (!listing) return {};
    own.release();
    list.stamp = stamp_of(s);
    for (std::size_t n = 0; n < kMostEntries; ++n, ++entries_) {
      const dirent* entry = ::readdir(listing.get());
      if (entry == nullptr) break;
      list.by_key[similar_key(entry->d_name)].emplace_back(entry->d_name);
    }
    for (auto& [key, names] : list.by_key) std::sort(names.begin(), names.end());
  }
  stamp = list.stamp;
  const auto found = list.by_key.find(similar_key(part));
  if (found == list.by_key.end()) return {};
  std::vector<std::string> like;
  for (const std::string& name : found->second)
    if (name != part && like.size() < kMostSimilar) like.push_back(name);
  return like;
}

FileRequest SimilarNames::request(const std::string& name) const {
  std::string list;
  for (const std::string& n : names) list += n + '\n';
  return {name, !names.empty(), sha256(text_bytes(list)), names.size(), folder, true};
}

SimilarNames similar_names(const std::string& folder, const std::string& name, FolderLists& lists) {
  Search search(lists);
  const Descriptor top(::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (top.get() >= 0) search.look(top.get(), "", name);
  return search.take();
}

}  // namespace texmesh
