#include "pipeline/batch/build_memo.h"

#include <sys/stat.h>

#include <algorithm>
#include <filesystem>

#include "format/base/archive.h"
#include "format/base/errors.h"
#include "pipeline/cache/cache_files.h"
#include "pipeline/io/atomic_file.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kMemoVersion = 1;
constexpr std::size_t kDigestBytes = 32;

struct PackedFile {
  std::string uri;
  std::uint8_t found = 0;
  Sha256 digest{};
  std::uint64_t bytes = 0;
  std::array<std::uint64_t, 3> identity{};
  std::array<std::int64_t, 2> times{};
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.uri, s.found, s.digest, s.bytes, s.identity, s.times);
  }
};
struct PackedKey {
  std::string stage;
  Sha256 key{};
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.stage, s.key);
  }
};
struct PackedRecord {
  Sha256 request{}, package_digest{};
  std::uint8_t failed = 0;
  std::int64_t looked_at_ns = 0;
  std::vector<PackedFile> files;
  std::vector<PackedKey> keys;
  std::array<std::uint64_t, 3> package_identity{};
  std::array<std::int64_t, 2> package_times{};
  std::uint64_t package_bytes = 0, peak_memory_bytes = 0;
  double seconds = 0;
  std::vector<std::string> error;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.request, s.package_digest, s.failed, s.looked_at_ns, s.files, s.keys, s.package_identity,
      s.package_times, s.package_bytes, s.peak_memory_bytes, s.seconds, s.error);
  }
};

std::array<std::uint64_t, 3> identity(const FileStamp& s) { return {s.device, s.inode, s.bytes}; }
std::array<std::int64_t, 2> times(const FileStamp& s) { return {s.modified_ns, s.changed_ns}; }
FileStamp stamp(const std::array<std::uint64_t, 3>& id, const std::array<std::int64_t, 2>& t) {
  return {id[0], id[1], id[2], t[0], t[1]};
}

std::vector<std::uint8_t> pack(const MemoRecord& r) {
  PackedRecord p{r.request,
                 r.package_digest,
                 static_cast<std::uint8_t>(r.failed),
                 r.looked_at_ns,
                 {},
                 {},
                 identity(r.package_stamp),
                 times(r.package_stamp),
                 r.package_bytes,
                 r.peak_memory_bytes,
                 r.seconds,
                 r.error};
  for (const FileRequest& f : r.files)
    p.files.push_back(
        {f.uri, static_cast<std::uint8_t>(f.found), f.digest, f.bytes, identity(f.stamp), times(f.stamp)});
  for (const auto& [stage, key] : r.keys) p.keys.push_back({stage, key});
  return encode_artefact(p);
}

MemoRecord unpack(std::span<const std::uint8_t> bytes) {
  const auto p = decode_artefact<PackedRecord>(bytes, "memo");
  MemoRecord r;
  r.request = p.request;
  r.package_digest = p.package_digest;
  r.failed = p.failed != 0;
  r.looked_at_ns = p.looked_at_ns;
  for (const PackedFile& f : p.files)
    r.files.push_back({f.uri, f.found != 0, f.digest, f.bytes, stamp(f.identity, f.times)});
  for (const PackedKey& k : p.keys) r.keys[k.stage] = k.key;
  r.package_stamp = stamp(p.package_identity, p.package_times);
  r.package_bytes = p.package_bytes;
  r.peak_memory_bytes = p.peak_memory_bytes;
  r.seconds = p.seconds;
  r.error = p.error;
  return r;
}

void put_u64(std::vector<std::uint8_t>& out, std::uint64_t v) {
  for (int i = 0; i < 8; ++i) out.push_back(static_cast<std::uint8_t>(v >> (8 * i)));
}
std::uint64_t get_u64(const std::vector<std::uint8_t>& in, std::size_t at) {
  std::uint64_t v = 0;
  for (int i = 7; i >= 0; --i) v = v << 8 | in[at + static_cast<std::size_t>(i)];
  return v;
}

/// Not through symbolic links: import does not follow them either.
std::optional<FileStamp> look(const std::string& path, bool follow) {
  struct stat s {};
  if ((follow ? ::stat(path.c_str(), &s) : ::lstat(path.c_str(), &s)) != 0 || !S_ISREG(s.st_mode))
    return std::nullopt;
  return stamp_of(s);
}

/// The file at `path` still has these bytes.
bool same_file(const std::string& path, bool follow, std::int64_t looked_at_ns, const Sha256& digest,
               std::uint64_t bytes, FileStamp& known, bool& refreshed) {
  const auto now = look(path, follow);
  if (!now || now->bytes != bytes) return false;
  if (*now == known && now->is_settled(looked_at_ns)) return true;
  const auto content = read_whole(path, bytes);
  if (!content || content->size() != bytes || sha256(*content) != digest) return false;
  known = *now;
  refreshed = true;
  return true;
}

}  // namespace

BuildMemo::BuildMemo(const std::string& cache_folder, const std::string& outputs) {
  if (cache_folder.empty()) return;
  Key name("memo", 1);
  name.add("outputs", outputs);
  path_ = cache_folder + "/memo/" + to_hex(name.digest()).substr(0, 32);
  load();
}

/// File: version, then per record the lengths of name and record, name, record; then the digest of all that.
void BuildMemo::load() {
  index_.clear();
  auto bytes = read_whole(path_);
  if (!bytes) return;
  const std::size_t end = bytes->size() - std::min(bytes->size(), kDigestBytes);
  const Sha256 digest = sha256(std::span(*bytes).first(end));
  was_damaged_ = bytes->size() < 8 + kDigestBytes ||
                 !std::equal(digest.begin(), digest.end(), bytes->begin() + static_cast<std::ptrdiff_t>(end));
  if (was_damaged_) return;
  bytes_ = std::move(*bytes);
  if (get_u64(bytes_, 0) != kMemoVersion) return;
  for (std::size_t at = 8; at + 16 <= end;) {
    const std::uint64_t name = get_u64(bytes_, at), record = get_u64(bytes_, at + 8);
    if (name > end - at - 16 || record > end - at - 16 - name) return;
    const std::string_view text(reinterpret_cast<const char*>(bytes_.data()) + at + 16, name);
    index_[text] = {at + 16 + name, record};
    at += 16 + name + record;
  }
}

bool BuildMemo::find(const std::string& package, MemoRecord& record) const {
  std::span<const std::uint8_t> bytes;
  if (const auto changed = changed_.find(package); changed != changed_.end()) {
    bytes = changed->second;
  } else {
    const auto it = index_.find(package);
    if (it == index_.end()) return false;
    bytes = std::span(bytes_).subspan(it->second.first, it->second.second);
  }
  try {
    record = unpack(bytes);
    return true;
  } catch (const FormatError&) {
    return false;
  }
}

void BuildMemo::set(const std::string& package, const MemoRecord& record) {
  changed_[package] = pack(record);
}

bool BuildMemo::save() {
  if (path_.empty() || changed_.empty()) return true;
  std::error_code ec;
  fs::create_directories(fs::path(path_).parent_path(), ec);
  const FileLock lock = FileLock::wait(path_ + ".lock", FileLock::Mode::kExclusive);
  load();  // somebody else may have saved since
  std::map<std::string_view, std::span<const std::uint8_t>> all;
  for (const auto& [name, place] : index_) all[name] = std::span(bytes_).subspan(place.first, place.second);
  for (const auto& [name, record] : changed_) all[name] = record;
  std::vector<std::uint8_t> out;
  put_u64(out, kMemoVersion);
  for (const auto& [name, record] : all) {
    put_u64(out, name.size());
    put_u64(out, record.size());
    out.insert(out.end(), name.begin(), name.end());
    out.insert(out.end(), record.begin(), record.end());
  }
  const Sha256 digest = sha256(out);
  out.insert(out.end(), digest.begin(), digest.end());
  try {
    write_file_atomically(path_, out);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

bool still_holds(MemoRecord& record, const std::string& input, const std::string& output, bool& refreshed) {
  refreshed = false;
  const std::int64_t now_ns = wall_clock_ns();
  const std::string folder = fs::path(input).parent_path().string();
  for (FileRequest& f : record.files) {
    const bool is_model = f.uri.empty();
    const std::string path = is_model ? input : folder.empty() ? f.uri : folder + "/" + f.uri;
    if (!f.found) {
      if (look(path, false)) return false;
      continue;
    }
    if (!same_file(path, is_model, record.looked_at_ns, f.digest, f.bytes, f.stamp, refreshed)) return false;
  }
  if (!record.failed && !same_file(output, true, record.looked_at_ns, record.package_digest,
                                   record.package_bytes, record.package_stamp, refreshed))
    return false;
  // What was settled before is so now; what was read just now was true at this moment.
  if (refreshed) record.looked_at_ns = now_ns;
  return !record.files.empty();
}

}  // namespace texmesh
