#include "pipeline/io/file_resolver.h"

#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/syscall.h>

#include "pipeline/io/names/similar_names.h"

namespace texmesh {
namespace {

// O_NONBLOCK: opening a FIFO or a device returns at once, fstat then refuses it.
constexpr int kReadFlags = O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY;
constexpr const char* kRegularFile = "a regular file";

std::string message(int error) { return std::generic_category().message(error); }

/// What says nothing about the file is an error of the machine.
[[noreturn]] void fail_to_read(const std::string& name, const std::string& place, int error) {
  std::string found = "cannot be read: " + message(error);
  switch (error) {
    case EACCES:
    case EPERM:
      throw PermissionError(name, place, "", std::move(found));
    case EIO:
    case EMFILE:
    case ENFILE:
    case ENOMEM:
    case ESTALE:
    case ETIMEDOUT:
    case EAGAIN:
      throw ResourceError(name, place, "", std::move(found));
    default:
      throw InputError(name, place, "", std::move(found));
  }
}

template <class F>
auto retry_on_signal(F&& call) {
  for (;;) {
    const auto result = call();
    if (result >= 0 || errno != EINTR) return result;
  }
}

/// -1 with errno; ENOSYS also stands for "this sandbox does not let openat2 through".
int open_with_openat2(int folder, const std::string& name) {
  open_how how{};
  how.flags = kReadFlags | O_NOFOLLOW;
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_SYMLINKS | RESOLVE_NO_MAGICLINKS;
  for (int attempt = 0; attempt < 16; ++attempt) {
    const long fd = ::syscall(SYS_openat2, folder, name.c_str(), &how, sizeof how);
    if (fd >= 0) return static_cast<int>(fd);
    // EAGAIN: something was renamed meanwhile. EPERM: what container runtimes without openat2 answer.
    if (errno == EPERM || errno == EINVAL || errno == E2BIG) errno = ENOSYS;
    if (errno != EINTR && errno != EAGAIN) return -1;
  }
  errno = ENOSYS;
  return -1;
}

/// `name` has passed check_relative_name, so no component is "..".
int open_component_wise(int folder, const std::string& name) {
  Descriptor held;
  int at = folder;
  for (std::size_t begin = 0;;) {
    const std::size_t end = std::min(name.find('/', begin), name.size());
    const std::string part = name.substr(begin, end - begin);
    const bool last = end == name.size();
    begin = end + 1;
    if (!last && (part.empty() || part == ".")) continue;
    const int flags = last ? kReadFlags | O_NOFOLLOW : O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC;
    const int fd = retry_on_signal([&] { return ::openat(at, part.c_str(), flags); });
    if (fd < 0) {
      // O_PATH|O_DIRECTORY|O_NOFOLLOW says ENOTDIR for a link to a folder; openat2 says ELOOP.
      struct stat s {};
      if (errno == ENOTDIR && ::fstatat(at, part.c_str(), &s, AT_SYMLINK_NOFOLLOW) == 0) {
        errno = S_ISLNK(s.st_mode) ? ELOOP : ENOTDIR;
      }
      return -1;
    }
    held.reset(fd);
    at = fd;
    if (last) return held.release();
  }
}

const char* kind_of(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a FIFO";
  if (S_ISSOCK(mode)) return "a socket";
  if (S_ISCHR(mode) || S_ISBLK(mode)) return "a device";
  return "something else";
}

/// The stamp is taken before the first byte is read: a change while reading gives another one later.
FileStamp checked_stamp(int fd, const std::string& name, const std::string& expected) {
  struct stat s {};
  if (::fstat(fd, &s) != 0) fail_to_read(name, "", errno);
  if (!S_ISREG(s.st_mode)) throw FileRefused(name, "", expected, kind_of(s.st_mode));
  return stamp_of(s);
}

Bytes read_all(int fd, std::uint64_t max_bytes, const std::string& name, const std::string& expected,
               FileStamp& stamp) {
  stamp = checked_stamp(fd, name, expected);
  const auto too_long = [&](std::uint64_t size) {
    return InputError(name, "", "a file of at most " + std::to_string(max_bytes) + " bytes",
                      std::to_string(size));
  };
  const std::uint64_t declared = stamp.bytes;
  if (declared > max_bytes) throw too_long(declared);
  // The file may grow or shrink meanwhile, and files of /proc declare 0 bytes: read until its end, not until
  // st_size.
  Bytes bytes(declared + 1);
  for (std::size_t size = 0;;) {
    if (size > max_bytes) throw too_long(size);
    if (size == bytes.size()) bytes.resize(size + (std::size_t{1} << 16));
    const ssize_t got = retry_on_signal([&] { return ::read(fd, bytes.data() + size, bytes.size() - size); });
    if (got < 0) fail_to_read(name, "byte " + std::to_string(size), errno);
    size += static_cast<std::size_t>(got);
    if (got == 0) {
      bytes.resize(size);
      return bytes;
    }
  }
}

}  // namespace

FileResolver::FileResolver(const std::filesystem::path& folder, std::vector<std::string> links_within,
                           Method method)
    : roots_(std::move(links_within)),
      walk_(method == Method::kWalk),
      lists_(std::make_unique<FolderLists>()) {
  const std::string name = folder.empty() ? "." : folder.string();
  folder_ = ::open(name.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
  if (folder_ < 0) throw InputError(name, "", "the model's folder", message(errno));
  roots_.insert(roots_.begin(), name);
}

FileResolver::~FileResolver() { ::close(folder_); }

std::size_t FileResolver::number_of(const std::string& uri) {
  const auto [it, is_new] = index_of_.try_emplace(uri, requests_.size());
  if (is_new) requests_.push_back({uri, false, {}, 0, {}, false});
  return it->second;
}

int FileResolver::open_beneath(int folder, const std::string& name) {
  if (!walk_) {
    const int fd = open_with_openat2(folder, name);
    if (fd >= 0 || errno != ENOSYS) return fd;
    walk_ = true;
  }
  return open_component_wise(folder, name);
}

/// git-annex, DVC and Bazel keep what they manage elsewhere in the repository, and links in its place.
int FileResolver::open_link(const std::string& uri) {
  namespace fs = std::filesystem;
  std::error_code ec;
  const fs::path target = fs::canonical(fs::path(roots_[0]) / uri, ec);
  if (ec && !fs::is_symlink(fs::symlink_status(fs::path(roots_[0]) / uri, ec))) return -1;
  if (target.empty()) throw FileRefused(uri, "", kRegularFile, "a symbolic link to a place where nothing is");
  for (const std::string& root : roots_) {
    const fs::path real = fs::canonical(root.empty() ? "." : root, ec);
    if (ec) continue;
    const std::string name = target.lexically_relative(real).string();
    const Descriptor folder(::open(real.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
    if (name.empty() || name == "." || name == ".." || name.starts_with("../") || folder.get() < 0) continue;
    const int fd = open_beneath(folder.get(), name);
    if (fd >= 0) return fd;
    if (errno != ELOOP && errno != EXDEV && errno != ENOENT) fail_to_read(uri, "", errno);
  }
  throw FileRefused(uri, "", kRegularFile,
                    "a symbolic link that leads out of the folder that was named (--links-within DIR allows "
                    "links that stay within DIR)");
}

bool FileResolver::is_in_source() {
  std::error_code ec;
  if (!own_path_) own_path_ = std::filesystem::canonical(roots_[0], ec);
  return own_path_->filename() == "source";
}

int FileResolver::open_beside(const std::string& uri) {
  namespace fs = std::filesystem;
  if (!is_in_source()) throw FileRefused(uri, "", kRegularFile, "a name that leaves the model's folder");
  const fs::path both = own_path_->parent_path();
  std::error_code ec;
  for (std::size_t i = 1; i < roots_.size(); ++i) {
    const fs::path root = fs::canonical(roots_[i], ec);
    if (ec || *both.lexically_relative(root).begin() == "..") continue;
    const Descriptor folder(::open(both.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
    if (folder.get() >= 0) return open_beneath(folder.get(), uri.substr(3));
  }
  if (!fs::is_directory(both / kTexturesBeside.substr(3), ec)) return errno = ENOENT, -1;
  throw FileRefused(
      uri, "", kRegularFile,
      "a file beside the model's folder: compile the folder of both, or give a ZIP archive of it");
}

/// Opens a uri that has a number; -1 when there is no such file.
int FileResolver::open_regular(const std::string& uri) {
  const bool beside = uri.starts_with(kTexturesBeside);
  try {
    check_relative_name(beside ? uri.substr(3) : uri, "", "");
  } catch (const InputError& e) {
    throw FileRefused(uri, "", e.expected(), e.found());
  }
  const int fd = beside ? open_beside(uri) : open_beneath(folder_, uri);
  if (fd >= 0) return fd;
  if (beside && (errno == ELOOP || errno == EXDEV)) return -1;
  switch (errno) {
    case ENOENT:
    case ENOTDIR:
    case ENAMETOOLONG:
      return -1;
    case ELOOP:
    case EXDEV:
      return open_link(uri);
    case ENXIO:
      throw FileRefused(uri, "", kRegularFile, "a socket");
    default:
      fail_to_read(uri, "", errno);
  }
}

std::optional<Bytes> FileResolver::read(const std::string& uri, std::uint64_t max_bytes) {
  const std::size_t index = number_of(uri);
  try {
    const Descriptor fd(open_regular(uri));
    if (fd.get() < 0) return std::nullopt;
    FileStamp stamp;
    Bytes bytes = read_all(fd.get(), max_bytes, uri, kRegularFile, stamp);
    requests_[index] = {uri, true, sha256(bytes), bytes.size(), stamp, false};
    return bytes;
  } catch (const ResourceError&) {
    failed_for_resources_ = true;
    throw;
  }
}

std::optional<Bytes> FileResolver::read_beside(const std::string& name, std::uint64_t max_bytes) {
  return is_in_source() ? read(std::string(kTexturesBeside) + name, max_bytes) : std::nullopt;
}

std::vector<std::string> FileResolver::similar(const std::string& uri) {
  SimilarNames found = similar_names(roots_[0], uri, *lists_);
  if (asked_similar_.insert(uri).second) requests_.push_back(found.request(uri));
  return std::move(found.names);
}

bool FileResolver::is_there(const std::string& uri) {
  try {
    const Descriptor fd(open_regular(uri));
    struct stat s {};
    return fd.get() >= 0 && ::fstat(fd.get(), &s) == 0 && S_ISREG(s.st_mode);
  } catch (const InputError&) {
    return false;
  }
}

void FileResolver::expect(std::vector<FileRequest> known) {
  for (FileRequest& r : known)
    if (r.found && !r.similar) expected_[r.uri] = std::move(r);
}

bool FileResolver::look(const std::string& uri, std::uint64_t max_bytes) {
  const auto known = expected_.find(uri);
  if (known != expected_.end()) {
    const std::size_t index = number_of(uri);
    const Descriptor fd(open_regular(uri));
    if (fd.get() < 0) return false;
    if (checked_stamp(fd.get(), uri, kRegularFile) == known->second.stamp) {
      requests_[index] = known->second;
      return true;
    }
  }
  return read(uri, max_bytes).has_value();
}

Bytes read_input_file(const std::filesystem::path& path, std::uint64_t max_bytes, FileStamp* stamp) {
  const std::string name = path.string();
  const Descriptor fd(retry_on_signal([&] { return ::open(name.c_str(), kReadFlags); }));
  if (fd.get() < 0 && errno == ENOENT) {
    const std::filesystem::path folder = path.parent_path();
    const SimilarNames similar = similar_names(folder.string(), path.filename().string());
    for (const std::string& other : similar.names)
      if (name_key(other) == name_key(path.filename().string()))
        throw InputError(name, "", "a readable file",
                         "only " + other + ", whose name differs in case or composition");
    errno = ENOENT;
  }
  if (fd.get() < 0) fail_to_read(name, "", errno);
  FileStamp own;
  return read_all(fd.get(), max_bytes, name, "a regular file", stamp ? *stamp : own);
}

}  // namespace texmesh
