#pragma once
#include <filesystem>
#include <memory>
#include <set>

#include "pipeline/io/file_stamp.h"
#include "pipeline/io/resolver.h"

namespace texmesh {

class FolderLists;

/// Opens files beneath one folder: openat2 with RESOLVE_BENEATH, RESOLVE_NO_SYMLINKS and
/// RESOLVE_NO_MAGICLINKS, or, where the kernel or a sandbox has no openat2, component by component with
/// O_NOFOLLOW. A symbolic link is followed where it leads, in the end, to a place beneath that folder or one
/// of `links_within`; the place is then opened in the same way. Regular files only; a FIFO does not block.
/// The folders themselves may be reached over symbolic links: the user named them, not the model. A model in
/// a folder `source`, as Sketchfab's downloads have it, finds files of the folder `textures` beside that
/// (kTexturesBeside) where the folder of both lies beneath one of `links_within`. Not thread-safe.
class FileResolver : public Resolver {
 public:
  enum class Method : std::uint8_t { kBest, kWalk };  // kWalk: as if there were no openat2
  /// Throws InputError when `folder` is not a folder that can be opened; "" is the current one.
  explicit FileResolver(const std::filesystem::path& folder, std::vector<std::string> links_within = {},
                        Method method = Method::kBest);
  ~FileResolver() override;
  FileResolver(const FileResolver&) = delete;
  FileResolver& operator=(const FileResolver&) = delete;

  std::optional<Bytes> read(const std::string& uri, std::uint64_t max_bytes) override;
  std::optional<Bytes> read_beside(const std::string& name, std::uint64_t max_bytes) override;
  std::vector<std::string> similar(const std::string& uri) override;

  /// What was known of files before: a file that has exactly such a stamp is not read to learn its digest.
  void expect(std::vector<FileRequest> known);
  /// As read(), but for the digest only: reads the file only when its stamp is not an expected one. False
  /// when it is not there.
  bool look(const std::string& uri, std::uint64_t max_bytes);
  /// Whether read() would find a file. Not recorded.
  bool is_there(const std::string& uri);

  /// A read has failed for reasons of the machine (ResourceError), whatever the reader made of that.
  bool failed_for_resources() const { return failed_for_resources_; }

  /// Everything that was asked for, once, in the order of first use; what was refused as not found.
  const std::vector<FileRequest>& requests() const { return requests_; }

 private:
  int open_beneath(int folder, const std::string& name);
  int open_link(const std::string& uri);
  int open_beside(const std::string& uri);
  bool is_in_source();
  int open_regular(const std::string& uri);
  std::size_t number_of(const std::string& uri);

  int folder_ = -1;
  std::optional<std::filesystem::path> own_path_;  // of the model's folder, once it was asked for
  std::vector<std::string> roots_;                 // the folder, then those of links
  bool walk_ = false, failed_for_resources_ = false;
  std::vector<FileRequest> requests_;
  std::map<std::string, std::size_t> index_of_;  // of files
  std::set<std::string> asked_similar_;
  std::unique_ptr<FolderLists> lists_;  // of folders where similar names are looked for
  std::map<std::string, FileRequest> expected_;
};

/// The model file itself, as the user names it (symbolic links are followed). Throws InputError when it is
/// missing, not a regular file, unreadable or longer than max_bytes; ResourceError where the machine is to
/// blame.
Bytes read_input_file(const std::filesystem::path& path, std::uint64_t max_bytes, FileStamp* stamp = nullptr);

/// For models that have everything inside.
class NoFiles : public Resolver {
 public:
  std::optional<Bytes> read(const std::string&, std::uint64_t) override { return std::nullopt; }
};

}  // namespace texmesh
