#include "tools/publish/view/served_files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "format/base/errors.h"
#include "format/container/layout.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "/packages/";
constexpr std::string_view kEnding = ".texmesh";
constexpr std::size_t kMaxListed = 10000;
constexpr int kMaxDepth = 8;

/// Media types that browsers insist on (scripts, WebAssembly), and those of SPEC.md.
std::string media_type(const std::string& path) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 16> kTypes{{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".map", "application/json"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".jpg", "image/jpeg"},
      {".webp", "image/webp"},
      {".ico", "image/x-icon"},
      {".wasm", "application/wasm"},
      {".woff2", "font/woff2"},
      {".txt", "text/plain; charset=utf-8"},
      {".glb", "model/gltf-binary"},
      {".texmesh", kContainerMediaType},
  }};
  for (const auto& [ending, type] : kTypes)
    if (path.ends_with(ending)) return std::string(type);
  return "application/octet-stream";
}

std::string etag_of(const struct stat& st) {
  char text[80];
  std::snprintf(text, sizeof text, "\"%llx-%llx-%llx%09lx\"", static_cast<unsigned long long>(st.st_ino),
                static_cast<unsigned long long>(st.st_size),
                static_cast<unsigned long long>(st.st_mtim.tv_sec),
                static_cast<unsigned long>(st.st_mtim.tv_nsec));
  return text;
}

/// The parts of a relative path; nothing where one of them is empty, hidden or leads upwards.
std::optional<std::vector<std::string>> parts_of(const std::string& path) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    std::string part = path.substr(begin, end - begin);
    if (part.empty() || part[0] == '.' || part.find('\0') != std::string::npos) return std::nullopt;
    parts.push_back(std::move(part));
    begin = end + 1;
  }
  return parts;
}

int open_part(int folder, const std::string& part, int flags) {
  return ::openat(folder, part.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC | flags);
}

bool has_manifest(int folder) {
  struct stat st {};
  return ::fstatat(folder, kManifestPath, &st, AT_SYMLINK_NOFOLLOW) == 0 && S_ISREG(st.st_mode);
}

std::optional<ServedFile> regular_file(int fd, const std::string& path) {
  if (fd < 0) return std::nullopt;
  struct stat st {};
  if (::fstat(fd, &st) != 0 || !S_ISREG(st.st_mode)) {
    ::close(fd);
    return std::nullopt;
  }
  return ServedFile(fd, static_cast<std::uint64_t>(st.st_size), media_type(path), etag_of(st));
}

/// The file at the end of `parts`. With `packages_only`, one named .texmesh or beneath a folder
/// with a manifest.
std::optional<ServedFile> open_beneath(int root, const std::vector<std::string>& parts, bool packages_only) {
  bool in_package = !packages_only;
  int folder = ::dup(root);
  for (std::size_t i = 0; folder >= 0 && i + 1 < parts.size(); ++i) {
    const int next = open_part(folder, parts[i], O_DIRECTORY);
    ::close(folder);
    folder = next;
    if (folder >= 0 && !in_package) in_package = has_manifest(folder);
  }
  if (folder < 0) return std::nullopt;
  const bool allowed = in_package || parts.back().ends_with(kEnding);
  const int fd = allowed ? open_part(folder, parts.back(), 0) : -1;
  ::close(folder);
  return regular_file(fd, parts.back());
}

int open_folder_or_throw(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) throw InputError(path, "", "", std::string("cannot be read: ") + std::strerror(errno));
  return fd;
}

void list_packages(const fs::path& folder, const std::string& prefix, int depth,
                   std::vector<std::string>& found) {
  std::error_code error;
  std::vector<fs::directory_entry> entries;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    entries.push_back(*it);
  std::ranges::sort(entries, {}, [](const fs::directory_entry& e) { return e.path(); });
  for (const fs::directory_entry& e : entries) {
    if (found.size() >= kMaxListed) return;
    const std::string name = e.path().filename().string();
    const fs::file_status status = e.symlink_status(error);
    if (name.starts_with(".")) continue;
    if (fs::is_regular_file(status) && name.ends_with(kEnding)) found.push_back(prefix + name);
    if (!fs::is_directory(status)) continue;
    if (fs::is_regular_file(fs::symlink_status(e.path() / kManifestPath, error)))
      found.push_back(prefix + name + "/");
    else if (depth < kMaxDepth)
      list_packages(e.path(), prefix + name + "/", depth + 1, found);
  }
}

/// viewer/ or model-viewer/, in which `file` stands.
std::string built_folder(const std::string& name, const char* file, const std::string& wanted) {
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  std::vector<fs::path> candidates{folder / ".." / name, folder / "../share/texmesh" / name};
  if (!wanted.empty()) candidates = {wanted};
  for (const fs::path& c : candidates)
    if (fs::is_regular_file(c / file, error)) return c.lexically_normal().string();
  fs::path build = (folder / "..").lexically_normal().parent_path();
  if (!fs::is_regular_file(build / "CMakeCache.txt", error)) build = "build/release";
  throw InputError(wanted.empty() ? "the " + name : wanted, "",
                   "the built " + name + "; to build it, run: cmake --build " + build.string() +
                       " --target viewer (it needs node and npm)",
                   std::string("no ") + file);
}

}  // namespace

ServedFile::~ServedFile() {
  if (fd_ >= 0) ::close(fd_);
}
ServedFile::ServedFile(ServedFile&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      bytes_(other.bytes_),
      type_(std::move(other.type_)),
      etag_(std::move(other.etag_)) {}

std::size_t ServedFile::read(std::uint64_t offset, char* to, std::size_t size) const {
  for (;;) {
    const ssize_t n = ::pread(fd_, to, size, static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    return n > 0 ? static_cast<std::size_t>(n) : 0;
  }
}

PackageFolder find_packages(const std::string& package) {
  std::error_code error;
  const fs::path path = fs::canonical(package, error);
  if (error) throw InputError(package, "", "", "cannot be read: " + error.message());
  const bool folder = fs::is_directory(path);
  const bool tree = folder && fs::is_regular_file(path / kManifestPath);
  if (!folder && !fs::is_regular_file(path))
    throw InputError(package, "", "a regular file", "something else");
  if (!folder || tree)
    return {path.parent_path().string(), {path.filename().string() + (tree ? "/" : "")}, true};
  PackageFolder found{path.string(), {}, false};
  list_packages(path, "", 0, found.packages);
  if (found.packages.empty())
    throw InputError(package, "", "a package, or a folder of packages", "no package in it");
  return found;
}

ServedFiles::ServedFiles(const std::string& package, const std::string& viewer) {
  const PackageFolder found = find_packages(package);
  viewer_ = open_folder_or_throw(viewer);
  root_ = open_folder_or_throw(found.path);
  if (found.alone) only_ = found.packages.front();
}

ServedFiles::~ServedFiles() {
  if (viewer_ >= 0) ::close(viewer_);
  if (root_ >= 0) ::close(root_);
}

std::optional<ServedFile> ServedFiles::open(const std::string& path) const {
  if (!path.starts_with("/")) return std::nullopt;
  if (path.starts_with(kPrefix)) {
    const std::string rest = path.substr(kPrefix.size());
    const bool tree = only_.ends_with("/");
    // The one package may have any name, hidden ones and names without .texmesh included: the user gave it.
    if (!only_.empty() && !tree)
      return rest == only_ ? regular_file(open_part(root_, rest, 0), rest) : std::nullopt;
    if (tree && !rest.starts_with(only_)) return std::nullopt;
    const auto parts = parts_of(tree ? rest.substr(only_.size()) : rest);
    if (!parts) return std::nullopt;
    if (!tree) return open_beneath(root_, *parts, true);
    const int package = open_part(root_, only_.substr(0, only_.size() - 1), O_DIRECTORY);
    if (package < 0) return std::nullopt;
    auto file = open_beneath(package, *parts, false);
    ::close(package);
    return file;
  }
  const auto parts = parts_of(path == "/" ? "index.html" : path.substr(1));
  return parts ? open_beneath(viewer_, *parts, false) : std::nullopt;
}

std::vector<std::string> ServedFiles::packages() const {
  std::vector<std::string> found;
  if (!only_.empty())
    found.push_back(only_);
  else
    list_packages("/proc/self/fd/" + std::to_string(root_), "", 0, found);
  for (std::string& p : found) p = std::string(kPrefix.substr(1)) + percent_encoded(p);
  return found;
}

std::string viewer_folder(const std::string& wanted) { return built_folder("viewer", "index.html", wanted); }
std::string model_viewer_folder(const std::string& wanted) {
  return built_folder("model-viewer", kModelViewerScript, wanted);
}

}  // namespace texmesh
