#include "pipeline/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <vector>

#include "format/errors.h"

namespace texmesh {
namespace {

struct Descriptor {
  int fd = -1;
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
};

[[noreturn]] void fail(const std::string& path, const char* step) {
  throw InputError(path, "", "a writable file", std::string(step) + ": " + std::strerror(errno));
}

void write_all(int fd, std::span<const std::uint8_t> bytes, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), std::min<std::size_t>(bytes.size(), 1 << 24));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(path, "write");
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
}

void sync_folder(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  Descriptor d{::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
  if (d.fd < 0 || ::fsync(d.fd) != 0) {
    // Some file systems cannot sync folders; the rename itself stands.
    if (errno != EINVAL && errno != ENOTSUP) fail(path, "fsync of the folder");
  }
}

std::string own_temporary(const std::string& path) {
  static std::atomic<unsigned> counter{0};
  return path + ".tmp" + std::to_string(::getpid()) + "-" + std::to_string(counter++);
}

}  // namespace

void write_file_atomically(const std::string& path, std::span<const std::uint8_t> bytes,
                           const std::string& temporary) {
  const std::string temp = temporary.empty() ? own_temporary(path) : temporary;
  try {
    {
      Descriptor d{::open(temp.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0666)};
      if (d.fd < 0) fail(path, "open");
      write_all(d.fd, bytes, path);
      if (::fdatasync(d.fd) != 0) fail(path, "fdatasync");
      const int fd = d.fd;
      d.fd = -1;
      if (::close(fd) != 0) fail(path, "close");
    }
    if (::rename(temp.c_str(), path.c_str()) != 0) fail(path, "rename");
  } catch (...) {
    ::unlink(temp.c_str());
    throw;
  }
  sync_folder(path);
}

bool file_holds(const std::string& path, std::span<const std::uint8_t> bytes) {
  Descriptor d{::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  struct stat st {};
  if (d.fd < 0 || ::fstat(d.fd, &st) != 0 || !S_ISREG(st.st_mode) ||
      static_cast<std::uint64_t>(st.st_size) != bytes.size())
    return false;
  std::vector<std::uint8_t> buffer(1 << 20);
  while (!bytes.empty()) {
    const ssize_t n = ::read(d.fd, buffer.data(), std::min(buffer.size(), bytes.size()));
    if (n <= 0 || std::memcmp(buffer.data(), bytes.data(), static_cast<std::size_t>(n)) != 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

}  // namespace texmesh
