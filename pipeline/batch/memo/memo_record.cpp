#include "pipeline/batch/memo/memo_record.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>

#include "format/base/archive.h"
#include "format/base/errors.h"
#include "pipeline/cache/cache_files.h"

namespace texmesh {
namespace {

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
  std::uint32_t stage = 0;  // in the segment's names
  Sha256 key{};
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.stage, s.key);
  }
};
struct PackedKeys {
  std::vector<PackedKey> keys;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.keys);
  }
};
struct PackedRecord {
  Sha256 request{}, package_digest{};
  std::uint8_t failed = 0;
  std::int64_t looked_at_ns = 0;
  std::vector<PackedFile> files;
  std::array<std::uint64_t, 3> package_identity{};
  std::array<std::int64_t, 2> package_times{};
  std::uint64_t package_bytes = 0, peak_memory_bytes = 0;
  double seconds = 0;
  std::vector<std::string> error;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.request, s.package_digest, s.failed, s.looked_at_ns, s.files, s.package_identity, s.package_times,
      s.package_bytes, s.peak_memory_bytes, s.seconds, s.error);
  }
};

std::array<std::uint64_t, 3> identity(const FileStamp& s) { return {s.device, s.inode, s.bytes}; }
std::array<std::int64_t, 2> times(const FileStamp& s) { return {s.modified_ns, s.changed_ns}; }
FileStamp stamp(const std::array<std::uint64_t, 3>& id, const std::array<std::int64_t, 2>& t) {
  return {id[0], id[1], id[2], t[0], t[1]};
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

std::uint32_t StageNames::number_of(const std::string& stage) {
  const auto at = std::find(names_.begin(), names_.end(), stage);
  if (at == names_.end()) return names_.push_back(stage), static_cast<std::uint32_t>(names_.size() - 1);
  return static_cast<std::uint32_t>(at - names_.begin());
}

const std::string& StageNames::name_of(std::uint32_t number) const {
  if (number >= names_.size())
    throw FormatError("memo", "stages", "at most " + std::to_string(names_.size()), std::to_string(number));
  return names_[number];
}

std::vector<std::uint8_t> pack_record(const MemoRecord& r) {
  PackedRecord p{r.request,
                 r.package_digest,
                 static_cast<std::uint8_t>(r.failed),
                 r.looked_at_ns,
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
  return encode_artefact(p);
}

MemoRecord unpack_record(std::span<const std::uint8_t> bytes) {
  auto p = decode_artefact<PackedRecord>(bytes, "memo");
  MemoRecord r;
  r.request = p.request;
  r.package_digest = p.package_digest;
  r.failed = p.failed != 0;
  r.looked_at_ns = p.looked_at_ns;
  for (PackedFile& f : p.files)
    r.files.push_back({std::move(f.uri), f.found != 0, f.digest, f.bytes, stamp(f.identity, f.times)});
  r.package_stamp = stamp(p.package_identity, p.package_times);
  r.package_bytes = p.package_bytes;
  r.peak_memory_bytes = p.peak_memory_bytes;
  r.seconds = p.seconds;
  r.error = std::move(p.error);
  return r;
}

std::vector<std::uint8_t> pack_keys(const StageKeys& keys, StageNames& stages) {
  std::vector<PackedKey> packed;
  for (const auto& [stage, key] : keys) packed.push_back({stages.number_of(stage), key});
  return encode_artefact(PackedKeys{std::move(packed)});
}

StageKeys unpack_keys(std::span<const std::uint8_t> bytes, const StageNames& stages) {
  StageKeys keys;
  for (const PackedKey& k : decode_artefact<PackedKeys>(bytes, "memo").keys)
    keys[stages.name_of(k.stage)] = k.key;
  return keys;
}

bool still_holds(MemoRecord& record, const std::string& input, const std::string& output, bool& refreshed) {
  refreshed = false;
  const std::int64_t now_ns = wall_clock_ns();
  const std::string_view folder = std::string_view(input).substr(0, input.rfind('/') + 1);
  for (FileRequest& f : record.files) {
    const bool is_model = f.uri.empty();
    const std::string path = is_model ? input : std::string(folder) + f.uri;
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
