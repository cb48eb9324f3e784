#include "pipeline/io/atomic_file.h"

#include <fcntl.h>

#include <atomic>
#include <cstdio>
#include <filesystem>

#include "pipeline/io/file_stamp.h"
#include "pipeline/io/machine.h"
#include "pipeline/io/resolver.h"

namespace texmesh {
namespace {

constexpr std::string_view kTemporaryMark = ".tmp-";

[[noreturn]] void fail(const std::string& path, const char* step) { fail_to_write(path, step, errno); }

std::string own_temporary(const std::string& path) {
  static std::atomic<std::size_t> counter{0};
  return temporary_name(path, counter++);
}

/// A new, empty file. -1 with errno; EEXIST when there is a file of this name, whoever is at work on it.
int open_temporary(const std::string& temp) {
  const int fd = ::open(temp.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666);
  struct stat there {};
  // A link that somebody has planted is no sign of another writer.
  if (fd < 0 && errno == EEXIST)
    errno = ::lstat(temp.c_str(), &there) == 0 && S_ISLNK(there.st_mode) ? ELOOP : EEXIST;
  return fd;
}

/// The parts of a temporary's name: what stands before ".tmp-", and its writer's mark.
struct TemporaryName {
  std::string_view stem, mark;
};

/// Nothing when the name is not temporary_name()'s.
std::optional<TemporaryName> temporary_parts(std::string_view name) {
  const std::size_t at = name.rfind(kTemporaryMark), dash = name.rfind('-');
  if (at == std::string_view::npos || at == 0) return std::nullopt;
  const std::size_t mark = at + kTemporaryMark.size();
  const std::string_view number = name.substr(dash + 1);
  if (dash <= mark || number.empty() || number.find_first_not_of("0123456789") != std::string_view::npos ||
      !is_owner_mark(name.substr(mark, dash - mark)))
    return std::nullopt;
  return TemporaryName{name.substr(0, at), name.substr(mark, dash - mark)};
}

/// Follows symbolic links, dangling ones too. More than 40 of them lead nowhere, as for open().
std::string behind_links(const std::string& path) {
  std::filesystem::path at = path;
  std::error_code ec;
  for (int i = 0; i < 40 && std::filesystem::is_symlink(at, ec); ++i) {
    const std::filesystem::path there = std::filesystem::canonical(at, ec);
    if (!ec) return there.string();
    at = at.parent_path() / std::filesystem::read_symlink(at, ec);
  }
  if (std::filesystem::is_symlink(at, ec)) {
    errno = ELOOP;
    fail(path, "open");
  }
  return at.string();
}

}  // namespace

std::string temporary_name(const std::string& path, std::size_t number) {
  const std::string mark = std::string(kTemporaryMark) + owner_mark() + "-" + std::to_string(number);
  // A name that becomes too long loses its beginning: what is in the file is told by the ending.
  const std::size_t name = path.rfind('/') + 1, bytes = path.size() - name;
  const std::size_t most = NAME_MAX - std::min<std::size_t>(mark.size(), NAME_MAX);
  return path.substr(0, name) + path.substr(name + bytes - std::min(bytes, most)) + mark;
}

void write_file_atomically(const std::string& path, ByteSpan bytes, const std::string& temporary) {
  std::string temp = temporary.empty() ? own_temporary(path) : temporary;
  Descriptor d{open_temporary(temp)};
  for (int i = 0; d.get() < 0 && errno == EEXIST && i < 100; ++i) {
    temp = own_temporary(path);
    d.reset(open_temporary(temp));
  }
  if (d.get() < 0) fail(path, "open");
  try {
    if (!write_all(d.get(), bytes)) fail(path, "write");
    if (::fdatasync(d.get()) != 0) fail(path, "fdatasync");
    if (::rename(temp.c_str(), path.c_str()) != 0) fail(path, "rename");
  } catch (...) {
    ::unlink(temp.c_str());
    throw;
  }
  if (!sync_folder(folder_of_file(path))) fail(path, "fsync of the folder");
}

void fail_to_write(const std::string& path, const std::string& step, int error) {
  std::string found = "cannot be written: " + (step.empty() ? "" : step + ": ") + std::strerror(error);
  switch (error) {
    case EACCES:
    case EPERM:
    case EROFS:
    case ENOENT:
    case ENOTDIR:
    case EISDIR:
    case EEXIST:
    case ELOOP:
    case ENAMETOOLONG:
      throw PermissionError(path, "", "", std::move(found));
    default:  // a disk that is full now, a server that does not answer now: nothing is wrong with the path
      throw ResourceError(path, "", "", std::move(found));
  }
}

bool is_special_file(const std::string& path) {
  // /dev/stdout is a link to what may be a regular file, which somebody else holds open.
  for (const char* folder : {"/dev/", "/proc/"})
    if (path.starts_with(folder) && !path.starts_with("/dev/shm/")) return true;
  std::error_code ec;
  const std::filesystem::file_status status = std::filesystem::status(path, ec);
  return std::filesystem::exists(status) && !std::filesystem::is_regular_file(status) &&
         !std::filesystem::is_directory(status);
}

void check_output_file(const std::string& path) {
  const std::filesystem::path file(path);
  std::error_code error;
  if (is_special_file(path) || std::filesystem::is_symlink(file, error)) return;
  if (std::filesystem::is_directory(file, error))
    throw InputError(path, "", "a file that can be written", "a folder");
  if (::access(folder_of_file(path).c_str(), W_OK) == 0) return;
  if (errno == EACCES || errno == EPERM || errno == EROFS) fail_to_write(path, "", errno);
  throw InputError(path, "", "", std::string("cannot be written: ") + std::strerror(errno));
}

void write_output_file(const std::string& path, ByteSpan bytes, const std::string& temporary) {
  if (is_special_file(path)) {
    const Descriptor d{::open(path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC)};
    if (d.get() < 0) fail(path, "open");
    if (!write_all(d.get(), bytes)) fail(path, "write");
    return;
  }
  const std::string target = behind_links(path);
  write_file_atomically(target, bytes, target == path ? temporary : "");
}

bool remove_stale_temporary(const std::string& path) {
  const std::string name = std::filesystem::path(path).filename().string();
  const auto parts = temporary_parts(name);
  struct stat there {};
  return parts && ::lstat(path.c_str(), &there) == 0 && S_ISREG(there.st_mode) &&
         !owner_may_live(parts->mark, stamp_of(there).modified_ns) && ::unlink(path.c_str()) == 0;
}

std::size_t remove_stale_temporaries(const std::string& folder, const std::string& ending) {
  std::vector<std::string> found;
  std::error_code ec;
  for (std::filesystem::directory_iterator it(folder.empty() ? "." : folder, ec), end; !ec && it != end;
       it.increment(ec)) {
    const std::string& path = it->path().native();
    const auto parts = temporary_parts(std::string_view(path).substr(path.rfind('/') + 1));
    if (parts && parts->stem.ends_with(ending)) found.push_back(path);
  }
  return static_cast<std::size_t>(std::count_if(found.begin(), found.end(), remove_stale_temporary));
}

bool file_holds(const std::string& path, ByteSpan bytes) {
  Descriptor d{::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  struct stat st {};
  if (d.get() < 0 || ::fstat(d.get(), &st) != 0 || !S_ISREG(st.st_mode) ||
      static_cast<std::uint64_t>(st.st_size) != bytes.size())
    return false;
  Bytes buffer(1 << 20);
  while (!bytes.empty()) {
    const ssize_t n = ::read(d.get(), buffer.data(), std::min(buffer.size(), bytes.size()));
    if (n <= 0 || std::memcmp(buffer.data(), bytes.data(), static_cast<std::size_t>(n)) != 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

}  // namespace texmesh
