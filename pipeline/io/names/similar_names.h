#pragma once

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

/// `name` is relative, with '/' between its parts and without "." and "..". A part that is there is taken as
/// it is; a folder is listed where a part is not there, and at the last part. No symbolic link is followed.
/// What cannot be listed counts as empty.
SimilarNames similar_names(const std::string& folder, const std::string& name);

}  // namespace texmesh
