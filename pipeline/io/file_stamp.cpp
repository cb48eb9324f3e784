#include "pipeline/io/file_stamp.h"

#include <fcntl.h>
#include <sys/sysmacros.h>

#include <ctime>
#include <filesystem>

namespace texmesh {
namespace {

std::int64_t nanoseconds(const timespec& t) { return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec; }

}  // namespace

std::string folder_of_file(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

bool sync_folder(const std::string& folder) {
  const Descriptor d{::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
  return d.get() >= 0 && (::fsync(d.get()) == 0 || errno == EINVAL || errno == ENOTSUP);
}

FileStamp stamp_of(const struct stat& s) {
  // Numbers of major 0 belong to the mount: NFS gives the same file another one on every node and after every
  // boot.
  const bool of_mount = major(s.st_dev) == 0;
  return {of_mount ? 0 : static_cast<std::uint64_t>(s.st_dev), static_cast<std::uint64_t>(s.st_ino),
          static_cast<std::uint64_t>(s.st_size), nanoseconds(s.st_mtim), nanoseconds(s.st_ctim)};
}

std::optional<FileStamp> stamp_of(const std::string& path) {
  struct stat s {};
  if (::stat(path.c_str(), &s) != 0 || !S_ISREG(s.st_mode)) return std::nullopt;
  return stamp_of(s);
}

std::int64_t wall_clock_ns() {
  timespec t{};
  ::clock_gettime(CLOCK_REALTIME, &t);
  return nanoseconds(t);
}

}  // namespace texmesh
