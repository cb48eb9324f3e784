#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "format/base/bytes.h"
#include "format/base/rule_error.h"
#include "format/container/container.h"

namespace texmesh {
namespace {

class FileSource final : public ByteSource {
 public:
  explicit FileSource(std::string path) : path_(std::move(path)) {
    // Non-blocking, so that a FIFO does not hang us before fstat can tell.
    fd_ = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd_ < 0) throw InputError(path_, "", "a readable file", std::strerror(errno));
    struct stat st {};
    if (::fstat(fd_, &st) != 0 || !S_ISREG(st.st_mode)) {
      ::close(fd_);
      throw InputError(path_, "", "a regular file", "something else");
    }
    size_ = static_cast<std::uint64_t>(st.st_size);
  }
  ~FileSource() override { ::close(fd_); }
  FileSource(const FileSource&) = delete;
  FileSource& operator=(const FileSource&) = delete;
  std::string name() const override { return path_; }
  std::uint64_t size() override { return size_; }
  Bytes read(std::uint64_t offset, std::uint64_t bytes) override {
    if (offset > size_ || bytes > size_ - offset)
      throw RuleError("K01", path_, "byte " + std::to_string(offset), std::to_string(bytes) + " bytes",
                      "a file of " + std::to_string(size_) + " bytes");
    Bytes out(static_cast<std::size_t>(bytes));
    std::size_t done = 0;
    while (done < out.size()) {
      const ssize_t n = ::pread(fd_, out.data() + done, out.size() - done, static_cast<off_t>(offset + done));
      if (n < 0 && errno == EINTR) continue;
      if (n < 0)
        throw InputError(path_, "byte " + std::to_string(offset + done), "readable bytes",
                         std::strerror(errno));
      if (n == 0)
        throw RuleError("K01", path_, "byte " + std::to_string(offset + done), "more bytes",
                        "the file became shorter");
      done += static_cast<std::size_t>(n);
    }
    return out;
  }

 private:
  std::string path_;
  int fd_ = -1;
  std::uint64_t size_ = 0;
};

class MemorySource final : public ByteSource {
 public:
  MemorySource(std::span<const std::uint8_t> bytes, std::string name)
      : bytes_(bytes), name_(std::move(name)) {}
  MemorySource(Bytes&& bytes, std::string name)
      : owned_(std::move(bytes)), bytes_(owned_), name_(std::move(name)) {}
  std::string name() const override { return name_; }
  std::uint64_t size() override { return bytes_.size(); }
  Bytes read(std::uint64_t offset, std::uint64_t bytes) override {
    if (offset > bytes_.size() || bytes > bytes_.size() - offset)
      throw RuleError("K01", name_, "byte " + std::to_string(offset), std::to_string(bytes) + " bytes",
                      "a package of " + std::to_string(bytes_.size()) + " bytes");
    const auto part = bytes_.subspan(static_cast<std::size_t>(offset), static_cast<std::size_t>(bytes));
    return {part.begin(), part.end()};
  }

 private:
  Bytes owned_;
  std::span<const std::uint8_t> bytes_;
  std::string name_;
};

}  // namespace

std::unique_ptr<ByteSource> open_file_source(const std::string& path) {
  return std::make_unique<FileSource>(path);
}

std::unique_ptr<ByteSource> memory_source(std::span<const std::uint8_t> bytes, std::string name) {
  return std::make_unique<MemorySource>(bytes, std::move(name));
}

std::unique_ptr<ByteSource> memory_source(std::vector<std::uint8_t>&& bytes, std::string name) {
  return std::make_unique<MemorySource>(std::move(bytes), std::move(name));
}

}  // namespace texmesh
