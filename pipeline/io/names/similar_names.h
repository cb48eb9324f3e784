#pragma once

#include <map>
#include <unordered_map>

#include "pipeline/io/file_stamp.h"

namespace texmesh {

/// What lies beneath a folder under a name, or under one with the same similar_key().
struct SimilarNames {
  std::vector<std::string> names;  // relative to the folder, sorted; the name itself is not among them
  /// Of the folder that was listed. While it stays as it is, so does the answer; zero where the answer hangs
  /// on more than one folder.
  FileStamp folder;
  FileRequest request(const std::string& name) const;
};

/// What folders have listed, by similar_key(). A folder is listed again only when it has changed: a model may
/// name thousands of files that are not there, in a folder of thousands. Not thread-safe.
class FolderLists {
 public:
  /// Entries of an open folder with the key of `part`, sorted, without `part` itself. `stamp`: of the folder.
  /// Nothing, and no stamp, where it cannot be listed.
  std::vector<std::string> entries_like(int folder, const std::string& part, FileStamp& stamp);

 private:
  struct List {
    FileStamp stamp;
    std::unordered_map<std::string, std::vector<std::string>> by_key;
  };
  std::map<std::pair<std::uint64_t, std::uint64_t>, List> lists_;  // by device and inode
  std::size_t entries_ = 0;
};

/// `name` is relative, with '/' between its parts and without "." and "..". A part that is there is taken as
/// it is; a folder is listed where a part is not there, and at the last part. No symbolic link is followed.
/// What cannot be listed counts as empty.
SimilarNames similar_names(const std::string& folder, const std::string& name, FolderLists& lists);
inline SimilarNames similar_names(const std::string& folder, const std::string& name) {
  FolderLists lists;
  return similar_names(folder, name, lists);
}

}  // namespace texmesh
