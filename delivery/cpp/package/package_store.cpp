#include <fcntl.h>
#include <sys/stat.h>

#include <filesystem>

#include "delivery/cpp/package/http_store.h"
#include "format/base/descriptor.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kManifestOffset = 64;  // of its data: the header always has the same length (SPEC.md)

void require_range(const std::string& file, const EntryRef& entry, std::uint64_t offset,
                   std::uint64_t bytes) {
  if (offset > entry.bytes || bytes > entry.bytes - offset)
    throw RuleError("E01", file, "entry " + entry.path,
                    std::to_string(bytes) + " bytes from " + std::to_string(offset),
                    "an entry of " + std::to_string(entry.bytes) + " bytes");
}

/// What stands in the place of a package, where its first bytes tell.
const char* kind_of_content(const Bytes& head) {
  const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
  const std::string_view words = text.substr(std::min(text.size(), text.find_first_not_of(" \t\r\n")));
  if (head.empty()) return "an empty file";
  if (text.starts_with("glTF") || text.starts_with("ply\n") || text.starts_with("ply\r"))
    return "a model: texmesh compile makes a package of it";
  if (text.find("\nv ") != text.npos && text.find("\nv ", text.find("\nv ") + 1) != text.npos)
    return "a model (OBJ): texmesh compile makes a package of it";
  if (words.starts_with("<")) return "a page of HTML or XML, as servers send in the place of a file";
  if (words.starts_with("{"))
    return text.find("\"asset\"") != text.npos ? "a model (glTF): texmesh compile makes a package of it"
                                               : "JSON";
  return text.starts_with("PK") ? "another ZIP archive" : "something else";
}

class ContainerStore final : public PackageStore {
 public:
  explicit ContainerStore(std::unique_ptr<ByteSource> source) : source_(std::move(source)) {}
  std::string name() const override { return source_->name(); }
  bool is_folder() const override { return false; }

  Bytes read_manifest() override {
    const Bytes head = source_->read(0, std::min(source_->size(), kBootstrapBytes));
    // Signature, no flags, stored, and the name: enough to know that what follows is meant to be a manifest.
    // That every other byte of the header is right is list()'s business.
    constexpr char kStart[] = "PK\3\4\12\0\0\0\0\0";
    const bool starts =
        head.size() >= kManifestOffset && std::equal(kStart, kStart + 10, head.begin()) &&
        std::equal(kManifestPath, kManifestPath + std::strlen(kManifestPath), head.begin() + 30);
    if (!starts) throw RuleError("K11", name(), "byte 0", "a texmesh package", kind_of_content(head));
    std::uint64_t bytes = 0;
    for (int i = 3; i >= 0; --i) bytes = bytes << 8 | head[static_cast<std::size_t>(22 + i)];
    if (bytes > head.size() - kManifestOffset)
      throw RuleError("K12", name(), "entry manifest.json",
                      "at most " + std::to_string(head.size() - kManifestOffset) + " bytes",
                      std::to_string(bytes));
    const auto begin = head.begin() + static_cast<std::ptrdiff_t>(kManifestOffset);
    return {begin, begin + static_cast<std::ptrdiff_t>(bytes)};
  }

  Bytes read(const EntryRef& entry, std::uint64_t offset, std::uint64_t bytes) override {
    require_range(name(), entry, offset, bytes);
    return source_->read(entry.offset + offset, bytes);
  }

  std::vector<ContainerEntry> list() override { return read_container(*source_); }

 private:
  std::unique_ptr<ByteSource> source_;
};

class FolderStore final : public PackageStore {
 public:
  explicit FolderStore(std::string root)
      : root_(std::move(root)), fd_(::open(root_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (fd_.get() < 0)
      throw InputError(root_, "", "", std::string("cannot be read: ") + std::strerror(errno));
  }
  std::string name() const override { return root_; }
  bool is_folder() const override { return true; }

  Bytes read_manifest() override {
    std::uint64_t bytes = 0;
    const Descriptor file = open_file(kManifestPath, bytes);
    if (bytes > kBootstrapBytes)
      throw RuleError("K12", root_, kManifestPath, "at most " + std::to_string(kBootstrapBytes) + " bytes",
                      std::to_string(bytes));
    return read_file(file, kManifestPath, 0, bytes);
  }

  Bytes read(const EntryRef& entry, std::uint64_t offset, std::uint64_t bytes) override {
    require_range(root_, entry, offset, bytes);
    std::uint64_t size = 0;
    const Descriptor file = open_file(entry.path, size);
    if (size != entry.bytes)
      throw RuleError("I08", root_, entry.path, std::to_string(entry.bytes) + " bytes", std::to_string(size));
    return read_file(file, entry.path, offset, bytes);
  }

  std::vector<ContainerEntry> list() override {
    std::vector<ContainerEntry> entries;
    std::error_code error;
    for (fs::recursive_directory_iterator it(root_, error), end; !error && it != end; it.increment(error)) {
      const std::string path = it->path().lexically_relative(root_).generic_string();
      const fs::file_status status = it->symlink_status(error);
      if (fs::is_directory(status)) continue;
      if (!fs::is_regular_file(status))
        throw RuleError("L05", root_, path, "a regular file", "something else");
      if (!is_valid_entry_path(path))
        throw RuleError("K05", root_, path, "a path of a-z 0-9 . _ -", "another");
      entries.push_back({path, 0, it->file_size(error), 0});
    }
    if (error) throw InputError(root_, "", "", "cannot be read: " + error.message());
    std::ranges::sort(entries, {}, &ContainerEntry::path);
    return entries;
  }

 private:
  /// Goes down part by part and follows no symbolic link, so that a tree from elsewhere cannot point
  /// out of itself.
  Descriptor open_file(const std::string& path, std::uint64_t& size) const {
    if (!is_valid_entry_path(path))
      throw RuleError("K05", root_, path, "a path within the package", "another");
    Descriptor folder(::dup(fd_.get()));
    std::size_t begin = 0;
    for (std::size_t end; (end = path.find('/', begin)) != std::string::npos; begin = end + 1)
      folder = open_at(folder, path.substr(begin, end - begin), O_DIRECTORY, path);
    Descriptor file = open_at(folder, path.substr(begin), O_NONBLOCK, path);
    struct stat st {};
    if (::fstat(file.get(), &st) != 0 || !S_ISREG(st.st_mode))
      throw RuleError("L05", root_, path, "a regular file", "something else");
    size = static_cast<std::uint64_t>(st.st_size);
    return file;
  }
  Descriptor open_at(const Descriptor& folder, const std::string& part, int flags,
                     const std::string& path) const {
    Descriptor d(::openat(folder.get(), part.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | flags));
    if (d.get() < 0 && errno == ENOENT && path == kManifestPath)
      throw RuleError("E01", root_, "", "a package, or a folder that unpack made",
                      "a folder without manifest.json");
    if (d.get() < 0)
      throw RuleError("E01", root_, path, "", std::string("cannot be read: ") + std::strerror(errno));
    return d;
  }
  Bytes read_file(const Descriptor& file, const std::string& path, std::uint64_t offset,
                  std::uint64_t bytes) const {
    Bytes out(static_cast<std::size_t>(bytes));
    if (read_at(file.get(), offset, out)) return out;
    if (errno == 0) throw RuleError("I08", root_, path, "more bytes", "the file became shorter");
    throw InputError(root_, path, "", std::string("cannot be read: ") + std::strerror(errno));
  }

  std::string root_;
  Descriptor fd_;
};

}  // namespace

std::unique_ptr<PackageStore> open_container(std::unique_ptr<ByteSource> source) {
  return std::make_unique<ContainerStore>(std::move(source));
}

std::unique_ptr<PackageStore> open_folder(const std::string& path) {
  return std::make_unique<FolderStore>(path);
}

std::unique_ptr<PackageStore> open_store(const std::string& path) {
  if (is_url(path)) return open_url(path);
  std::error_code error;
  if (!fs::is_directory(path, error)) return open_container(open_file_source(path));
  if (!fs::exists(fs::path(path) / kManifestPath, error))
    for (fs::directory_iterator it(path, error), end; !error && it != end; it.increment(error))
      if (it->path().extension() == ".texmesh")
        throw InputError(path, "", "a package",
                         "a folder without manifest.json that has packages: name one of them");
  return open_folder(path);
}

}  // namespace texmesh
