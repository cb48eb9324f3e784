#include "pipeline/io/new_folder.h"

#include <fcntl.h>

#include <cstdio>
#include <fstream>

#include "format/base/text_bytes.h"
#include "pipeline/io/file_stamp.h"

namespace texmesh {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void fail_output(const fs::path& path, const char* step) {
  throw InputError(path.string(), "", "", std::string("cannot be ") + step + ": " + std::strerror(errno));
}

void sync_new_folder(const fs::path& folder) {
  if (!sync_folder(folder.string())) fail_output(folder, "synced");
}

void write_new_file(const fs::path& path, ByteSpan bytes) {
  const Descriptor d{::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644)};
  if (d.get() < 0) fail_output(path, "made");
  if (!write_all(d.get(), bytes) || ::fdatasync(d.get()) != 0) fail_output(path, "written");
}

std::set<std::string> made_files(const fs::path& folder) {
  std::ifstream in(folder / kMadeFiles);
  std::set<std::string> out{kMadeFiles};
  for (std::string line; std::getline(in, line);) out.insert(line);
  return out;
}

/// Nobody's bytes are copied where the file can have a second name.
void keep_file(const fs::path& from, const fs::path& to) {
  std::error_code ec;
  fs::create_directories(to.parent_path(), ec);
  if (fs::is_symlink(from))
    fs::copy_symlink(from, to, ec);
  else if (fs::create_hard_link(from, to, ec); ec)
    fs::copy_file(from, to, ec);
  if (ec)
    throw InputError(from.string(), "", "a name that no new file has, since texmesh has not made this one",
                     "it cannot stay: " + ec.message() + " (move it elsewhere)");
}

}  // namespace

bool is_made_folder(const fs::path& folder) {
  std::error_code ec;
  return fs::exists(folder / kMadeFiles, ec);
}

FolderRule marked_folder_rule(const std::string& name, std::string_view begin, std::string replaceable) {
  const auto known = [name, text = std::string(begin)](const fs::path& folder) {
    std::ifstream file(folder / name, std::ios::binary);
    std::string head(text.size(), '\0');
    file.read(head.data(), static_cast<std::streamsize>(head.size()));
    return file && head == text;
  };
  return {true, known, "", std::move(replaceable), true};
}

NewFolder::NewFolder(const std::string& folder, FolderRule rule) : rule_(std::move(rule)) {
  std::error_code ec;
  target_ = fs::absolute(fs::path(folder).has_filename() ? fs::path(folder) : fs::path(folder).parent_path());
  if (fs::exists(target_, ec)) target_ = fs::canonical(target_);
  check_target();
  std::string name =
      (target_.parent_path() / ("." + target_.filename().string() + ".texmesh.tmpXXXXXX")).string();
  if (!::mkdtemp(name.data())) fail_output(target_.parent_path(), "written");
  tree_ = name;
}

NewFolder::~NewFolder() {
  std::error_code ec;
  if (!tree_.empty()) fs::remove_all(tree_, ec);
}

void NewFolder::add(const std::string& path, ByteSpan bytes) {
  const fs::path file = tree_ / path, folder = file.parent_path();
  if (folders_.insert(folder).second) fs::create_directories(folder);
  write_new_file(file, bytes);
}

void NewFolder::copy(const std::string& path, const fs::path& source) {
  std::error_code ec;
  if (!fs::is_directory(source, ec)) return copy_file(tree_ / path, source);
  std::vector<fs::path> files;
  for (auto it = fs::recursive_directory_iterator(source, ec); !ec && it != fs::end(it); it.increment(ec)) {
    const bool hidden = it->path().filename().string().starts_with('.');
    if (hidden && it->is_directory(ec)) it.disable_recursion_pending();
    if (!hidden && fs::is_regular_file(it->symlink_status())) files.push_back(it->path());
  }
  if (ec) throw InputError(source.string(), "", "", "cannot be read: " + ec.message());
  for (const fs::path& file : files) copy_file(tree_ / path / file.lexically_relative(source), file);
}

void NewFolder::copy_file(const fs::path& file, const fs::path& source) {
  if (folders_.insert(file.parent_path()).second) fs::create_directories(file.parent_path());
  std::error_code ec, none;
  fs::copy_file(source, file, ec);
  fs::permissions(file, fs::perms{0644}, none);
  const Descriptor d{::open(file.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC)};
  // It says "Input/output error" of a disk that is full, too. One more byte tells.
  if (ec == std::errc::io_error && d.get() >= 0 && !write_all(d.get(), Bytes(1)))
    fail_output(file, "written");
  if (ec) throw InputError(source.string(), "", "", "cannot be copied: " + ec.message());
  if (d.get() < 0 || ::fdatasync(d.get()) != 0) fail_output(file, "written");
}

bool NewFolder::replace_without_exchange() {
  if (errno != EXDEV && errno != EINVAL && errno != ENOSYS && errno != ENOTSUP) return false;
  const fs::path aside = tree_.string() + "-old";
  std::error_code ec;
  fs::rename(target_, aside, ec);
  if (ec) fs::remove_all(target_, ec);  // overlayfs moves no folder of a layer beneath it
  if (::rename(tree_.c_str(), target_.c_str()) != 0) return false;
  fs::remove_all(aside, ec);
  return true;
}

void NewFolder::list_files() {
  std::string text;
  for (const auto& e : fs::recursive_directory_iterator(tree_))
    if (!e.is_directory()) text += e.path().lexically_relative(tree_).string() + "\n";
  add(kMadeFiles, text_bytes(text));
}

void NewFolder::keep_others() {
  if (!fs::exists(target_)) return;
  const std::set<std::string> made = made_files(target_);
  for (const auto& e : fs::recursive_directory_iterator(target_)) {
    const fs::path path = e.path().lexically_relative(target_);
    const bool is_folder = e.is_directory() && !e.is_symlink();
    if (!is_folder && !made.contains(path.string())) keep_file(e.path(), tree_ / path);
  }
}

void NewFolder::publish() {
  if (rule_.keeps_others) list_files(), keep_others();
  for (const auto& e : fs::recursive_directory_iterator(tree_))
    if (e.is_directory()) sync_new_folder(e.path());
  if (::chmod(tree_.c_str(), 0755) != 0) fail_output(tree_, "a folder of one's own");
  sync_new_folder(tree_);
  check_target();
  if (fs::exists(target_) && !fs::is_empty(target_)) {
    // Both names stay whole at any moment: the old tree moves into the temporary name, which
    // the destructor removes.
    if (::renameat2(AT_FDCWD, tree_.c_str(), AT_FDCWD, target_.c_str(), RENAME_EXCHANGE) != 0 &&
        !replace_without_exchange())
      fail_output(target_, "a folder that can be replaced");
  } else {
    if (::rename(tree_.c_str(), target_.c_str()) != 0) fail_output(target_, "a folder that can be made");
    tree_.clear();
  }
  sync_new_folder(target_.parent_path());
}

void NewFolder::check_target() const {
  if (!fs::exists(fs::symlink_status(target_))) return;
  if (!fs::is_directory(target_))
    throw InputError(target_.string(), "", "a folder, or nothing yet", "a file");
  if (fs::is_empty(target_)) return;
  if (!rule_.replace) throw InputError(target_.string(), "", rule_.instead, "a folder with files");
  if (!rule_.known(target_))
    throw InputError(target_.string(), "", rule_.replaceable, "a folder with other files");
  if (rule_.keeps_others && !is_made_folder(target_))
    throw InputError((target_ / kMadeFiles).string(), "", "the names of the files that texmesh has made",
                     "none, so nobody knows which ones are somebody else's: remove the folder");
}

ScratchFolder::ScratchFolder(const std::string& name) {
  std::string made = (fs::temp_directory_path() / (name + "-XXXXXX")).string();
  if (!::mkdtemp(made.data())) throw InputError(made, "", "a folder that can be made", "an error");
  path_ = made;
}

ScratchFolder::~ScratchFolder() {
  std::error_code error;
  fs::remove_all(path_, error);
}

}  // namespace texmesh
