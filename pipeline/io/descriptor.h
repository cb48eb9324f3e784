#pragma once
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>

namespace texmesh {

/// An open file of the operating system, or none (-1). The destructor closes the file.
class Descriptor {
 public:
  explicit Descriptor(int fd = -1) : fd_(fd) {}
  ~Descriptor() { reset(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  int release() { return std::exchange(fd_, -1); }
  void reset(int fd = -1) {
    if (fd_ >= 0) ::close(fd_);
    fd_ = fd;
  }

 private:
  int fd_;
};

/// Writes all of it, in pieces that every system takes at once; false, with errno, where that fails.
inline bool write_all(int fd, std::span<const std::uint8_t> bytes) {
  constexpr std::size_t kPieceBytes = 1 << 24;
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), std::min(bytes.size(), kPieceBytes));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}
inline bool write_all(int fd, std::string_view text) {
  return write_all(fd, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

}  // namespace texmesh
