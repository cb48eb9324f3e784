#pragma once
#include <filesystem>
#include <functional>
#include <set>

#include "format/base/bytes.h"

namespace texmesh {

/// Names the files of a folder that texmesh has made, a line each. What else is in the folder is somebody's:
/// it stays when the folder is made anew, and no search for models or packages looks into such a folder.
inline constexpr const char* kMadeFiles = ".texmesh-files";
bool is_made_folder(const std::filesystem::path& folder);

/// What may become of a folder that is there already and holds files.
struct FolderRule {
  bool replace = false;  // where `known` says yes
  std::function<bool(const std::filesystem::path& folder)>
      known;            // whether the folder is of the kind written
  std::string instead;  // for the error without `replace`: what is expected in place of a folder with files
  std::string replaceable;    // for the error with `replace`: the only kind of folder that is replaced
  bool keeps_others = false;  // kMadeFiles is written, and files that an earlier one does not name stay
};

/// A folder is new or empty, or its file `name` begins with `begin` and it is replaced, but for the files
/// that somebody else has put there. `replaceable` as above.
FolderRule marked_folder_rule(const std::string& name, std::string_view begin, std::string replaceable);

/// A folder under a temporary name beside its own, which takes its own name in publish(), or disappears with
/// this object. InputError when the folder cannot be written, or when the rule forbids to replace what is
/// there.
class NewFolder {
 public:
  NewFolder(const std::string& folder, FolderRule rule);
  ~NewFolder();
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;

  /// A file of the folder; `path` is relative, the caller vouches that it leads nowhere else. No path twice.
  void add(const std::string& path, ByteSpan bytes);
  /// A file that stands on this machine, or all files beneath a folder but hidden ones; symbolic links are
  /// left out. `path` as of add(). InputError where one cannot be read.
  void copy(const std::string& path, const std::filesystem::path& source);
  /// Files and folders are on the disk before the name is taken. What is replaced goes away in one step, but
  /// on file systems that cannot exchange two folders (NFS, FUSE, overlayfs), where there is none for a
  /// moment. InputError where a file that stays has the name of a new one.
  void publish();

 private:
  void check_target() const;
  void list_files();
  void keep_others();
  bool replace_without_exchange();
  void copy_file(const std::filesystem::path& file, const std::filesystem::path& source);

  std::filesystem::path target_, tree_;
  std::set<std::filesystem::path> folders_;
  FolderRule rule_;
};

/// A new folder among the machine's temporary ones, which goes with this object and all that is in it.
class ScratchFolder {
 public:
  /// `name`: what its name begins with. InputError where it cannot be made.
  explicit ScratchFolder(const std::string& name);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace texmesh
