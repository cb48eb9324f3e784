#include "pipeline/batch/memo/memo_segment.h"

#include <fcntl.h>

#include <filesystem>
#include <numeric>

#include "format/base/archive.h"
#include "format/base/text_bytes.h"
#include "pipeline/cache/cache_files.h"
#include "pipeline/io/machine.h"
#include "pipeline/io/names/similar_names.h"

namespace texmesh {
namespace {

/// The file at `path` still has these bytes.
bool same_file(const std::string& path, std::int64_t looked_at_ns, const Sha256& digest, std::uint64_t bytes,
               FileStamp& known, bool& refreshed) {
  const auto now = stamp_of(path);
  if (!now || now->bytes != bytes) return false;
  if (*now == known && now->is_settled(looked_at_ns)) return true;
  const auto content = read_whole(path, bytes);
  if (!content || content->size() != bytes || sha256(*content) != digest) return false;
  known = *now;
  refreshed = true;
  return true;
}

/// The folder of `path`, or the nearest one above it that is there, is as it was.
bool same_folder(std::string path, std::int64_t looked_at_ns, const FileStamp& known) {
  struct stat s {};
  do {
    const std::size_t slash = path.rfind('/');
    path = slash == std::string::npos ? "." : path.substr(0, std::max<std::size_t>(slash, 1));
    if (::stat(path.c_str(), &s) == 0) return stamp_of(s) == known && known.is_settled(looked_at_ns);
  } while (path != "." && path != "/");
  return false;
}

/// As many names like that of `f` are beneath the folder as there were, and the same.
bool same_names(const std::string& folder, std::int64_t looked_at_ns, FileRequest& f, bool& refreshed,
                FolderLists& lists) {
  if (f.stamp != FileStamp{} && same_folder(folder + f.uri, looked_at_ns, f.stamp)) return true;
  const FileRequest now = similar_names(folder, f.uri, lists).request(f.uri);
  if (now.digest != f.digest || now.bytes != f.bytes) return false;
  f.stamp = now.stamp;
  refreshed = true;
  return true;
}

struct PackedKey {
  std::uint32_t stage = 0;  // in the segment's names
  Sha256 key{};
  static void archive(auto& s, auto& a) { a(s.stage, s.key); }
};
struct PackedKeys {
  std::vector<PackedKey> keys;
  static void archive(auto& s, auto& a) { a(s.keys); }
};

Bytes pack_keys(const StageKeys& keys, StageNames& stages) {
  std::vector<PackedKey> packed;
  for (const auto& [stage, key] : keys) packed.push_back({stages.number_of(stage), key});
  return encode_artefact(PackedKeys{std::move(packed)});
}

StageKeys unpack_keys(ByteSpan bytes, const StageNames& stages) {
  StageKeys keys;
  for (const PackedKey& k : decode_artefact<PackedKeys>(bytes, "memo").keys)
    keys[stages.name_of(k.stage)] = k.key;
  return keys;
}

constexpr std::array<std::uint8_t, 8> kMagic{'T', 'X', 'M', 'E', 'M', 'O', 0, 4};
constexpr std::size_t kMostBlockBytes = 8u << 20, kFullBlockBytes = 1u << 20;
constexpr std::string_view kOpenEnding = ".open", kFinishedEnding = ".seg";

struct BlockHead {
  std::uint64_t bytes = 0;
  Sha256 digest{};
};
constexpr std::size_t kBlockHeadBytes = 8 + 32;

struct Block {
  std::vector<std::string> new_stages;
  std::vector<MemoName> names;
  std::vector<std::int64_t> times;
  std::vector<std::uint32_t> sizes;
  std::uint64_t body_bytes = 0;
  static void archive(auto& s, auto& a) { a(s.new_stages, s.names, s.times, s.sizes, s.body_bytes); }
};

/// In front of a memo. What check is of begins behind it.
struct MemoHead {
  std::uint64_t check = 0;
  std::uint32_t keys_ahead = 0;  // bytes from this head to the keys' check
  std::uint32_t key_bytes = 0;   // with the check
};
constexpr std::size_t kCheckBytes = 8, kMemoHeadBytes = 16;
static_assert(sizeof(MemoHead) == kMemoHeadBytes);

std::uint64_t check_of(ByteSpan bytes) { return truncated(sha256(bytes)); }

/// The bytes behind a check that holds; none where it does not.
ByteSpan checked(ByteSpan bytes) {
  if (bytes.size() < kCheckBytes) return {};
  return value_at<std::uint64_t>(bytes.data()) == check_of(bytes.subspan(kCheckBytes))
             ? bytes.subspan(kCheckBytes)
             : ByteSpan{};
}

void append_bytes(Bytes& to, const void* from, std::size_t size) {
  const auto* p = static_cast<const std::uint8_t*>(from);
  to.insert(to.end(), p, p + size);
}

BlockHead head_of(std::span<const std::uint8_t, kBlockHeadBytes> bytes) {
  return {value_at<std::uint64_t>(bytes.data()), value_at<Sha256>(bytes.data() + 8)};
}

}  // namespace

bool still_holds(PackageMemo& memo, const std::string& input, const std::string& output, bool& refreshed) {
  refreshed = false;
  const std::int64_t now_ns = wall_clock_ns();
  const std::string_view folder = std::string_view(input).substr(0, input.rfind('/') + 1);
  if (std::string_view(input).substr(folder.size()) != memo.input_name) return false;
  FolderLists lists;
  for (FileRequest& f : memo.files) {
    const std::string path = f.uri.empty() ? input : std::string(folder) + f.uri;
    const bool same = f.similar ? same_names(std::string(folder), memo.looked_at_ns, f, refreshed, lists)
                      : f.found ? same_file(path, memo.looked_at_ns, f.digest, f.bytes, f.stamp, refreshed)
                                : !stamp_of(path);
    if (!same) return false;
  }
  if (!memo.failed && !same_file(output, memo.looked_at_ns, memo.package_digest, memo.package_bytes,
                                 memo.package_stamp, refreshed))
    return false;
  // What was settled before is so now; what was read just now was true at this moment.
  if (refreshed) memo.looked_at_ns = now_ns;
  return !memo.files.empty();
}

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

MemoName memo_name(const std::string& package) {
  const Sha256 digest = sha256(text_bytes(package));
  MemoName name;
  std::copy_n(digest.begin(), name.size(), name.begin());
  return name;
}

bool MemoSegment::is_finished() const { return path_.ends_with(kFinishedEnding); }

std::unique_ptr<MemoSegment> MemoSegment::read(const std::string& path,
                                               const std::function<void(MemoEntry)>& entry) {
  std::unique_ptr<MemoSegment> segment(new MemoSegment);
  segment->path_ = path;
  segment->file_.reset(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat s {};
  if (segment->file_.get() < 0 || ::fstat(segment->file_.get(), &s) != 0 || !S_ISREG(s.st_mode))
    return nullptr;
  segment->bytes_ = static_cast<std::uint64_t>(s.st_size);
  segment->modified_ns_ = stamp_of(s).modified_ns;
  // Another machine may see the end of a file that grows as zeros.
  segment->damaged_ = !segment->read_blocks(entry) && segment->is_finished();
  return segment;
}

/// False where bytes are not what a writer of segments writes.
bool MemoSegment::read_blocks(const std::function<void(MemoEntry)>& entry) {
  std::array<std::uint8_t, kMagic.size()> magic{};
  const bool cut = bytes_ < magic.size();
  if (cut) return !is_finished();
  if (!read_at(file_.get(), 0, magic) || magic != kMagic) return false;
  bool last = false;
  std::uint64_t at = magic.size();
  while (!last && at + kBlockHeadBytes <= bytes_) {
    std::array<std::uint8_t, kBlockHeadBytes> bytes;
    if (!read_at(file_.get(), at, bytes)) return false;
    const BlockHead head = head_of(bytes);
    if (head.bytes > kMostBlockBytes) return false;
    if (head.bytes > bytes_ - at - kBlockHeadBytes) break;
    Bytes payload(static_cast<std::size_t>(head.bytes));
    if (!read_at(file_.get(), at + kBlockHeadBytes, payload) || sha256(payload) != head.digest) return false;
    at += kBlockHeadBytes + head.bytes;
    const auto body_bytes = tell_block(payload, at, entry, last);
    if (!body_bytes) return false;
    at += *body_bytes;
    if (at > bytes_) return !is_finished();
  }
  return is_finished() ? last && at == bytes_ : true;
}

std::optional<std::uint64_t> MemoSegment::tell_block(ByteSpan payload, std::uint64_t body,
                                                     const std::function<void(MemoEntry)>& entry,
                                                     bool& last) {
  Block block;
  try {
    block = decode_artefact<Block>(payload, "memo");
  } catch (const FormatError&) {
    return std::nullopt;
  }
  const std::size_t count = block.names.size();
  const auto memos_bytes = std::accumulate(block.sizes.begin(), block.sizes.end(), std::uint64_t{0});
  if (block.times.size() != count || block.sizes.size() != count || memos_bytes > block.body_bytes ||
      block.body_bytes > kMostBlockBytes)
    return std::nullopt;
  for (const std::string& stage : block.new_stages) stages_.number_of(stage);
  if (block.body_bytes > bytes_ - body) return block.body_bytes;  // cut off
  std::uint64_t offset = body;
  for (std::size_t i = 0; i < count; ++i) {
    entry({block.names[i], block.times[i], offset, block.sizes[i]});
    offset += block.sizes[i];
  }
  last = block.names.empty();
  return block.body_bytes;
}

/// Models are asked for about in the order in which they were remembered: one read serves many.
ByteSpan MemoSegment::look(Window& window, std::uint64_t at, std::size_t bytes) const {
  constexpr std::size_t kWindowBytes = 8 << 10;
  if (at < window.at || at + bytes > window.at + window.bytes.size()) {
    const std::uint64_t rest = at < bytes_ ? bytes_ - at : 0;
    window.bytes.resize(
        static_cast<std::size_t>(std::min<std::uint64_t>(std::max(bytes, kWindowBytes), rest)));
    window.at = at;
    if (window.bytes.size() < bytes || !read_at(file_.get(), at, window.bytes)) window.bytes.clear();
  }
  if (window.bytes.empty()) return {};
  return std::span(window.bytes).subspan(static_cast<std::size_t>(at - window.at), bytes);
}

std::optional<PackageMemo> MemoSegment::memo(const MemoEntry& entry) const {
  const ByteSpan bytes = checked(look(memo_window_, entry.offset, entry.bytes));
  constexpr std::size_t kRestOfHead = kMemoHeadBytes - kCheckBytes;
  try {
    if (bytes.size() >= kRestOfHead) return decode_artefact<PackageMemo>(bytes.subspan(kRestOfHead), "memo");
  } catch (const FormatError&) {
  }
  damaged_ = true;
  return std::nullopt;
}

StageKeys MemoSegment::keys(const MemoEntry& entry) const {
  const ByteSpan bytes = look(memo_window_, entry.offset, entry.bytes);
  const MemoHead head = bytes.size() >= kMemoHeadBytes && !checked(bytes).empty()
                            ? value_at<MemoHead>(bytes.data())
                            : MemoHead{};
  try {
    if (head.key_bytes > 0 && head.key_bytes <= kMostBlockBytes && head.keys_ahead <= kMostBlockBytes)
      return unpack_keys(checked(look(key_window_, entry.offset + head.keys_ahead, head.key_bytes)), stages_);
  } catch (const FormatError&) {
  }
  damaged_ = true;
  return {};
}

void MemoSegmentWriter::add(const MemoName& name, const PackageMemo& memo) {
  const Bytes bytes = encode_artefact(memo), keys = pack_keys(memo.keys, stages_);
  const std::size_t size = kMemoHeadBytes + bytes.size() + kCheckBytes + keys.size();
  if (size > kMostBlockBytes / 2) return;  // a model of ten thousand files is looked at again
  if (memos_.size() + keys_.size() + size > kFullBlockBytes) flush();
  names_.push_back(name);
  times_.push_back(memo.looked_at_ns);
  const MemoHead head{0, static_cast<std::uint32_t>(keys_.size()),
                      static_cast<std::uint32_t>(kCheckBytes + keys.size())};
  sizes_.push_back(static_cast<std::uint32_t>(kMemoHeadBytes + bytes.size()));
  append_bytes(memos_, &head, sizeof head);
  memos_.insert(memos_.end(), bytes.begin(), bytes.end());
  const std::uint64_t check = check_of(keys);
  append_bytes(keys_, &check, sizeof check);
  keys_.insert(keys_.end(), keys.begin(), keys.end());
}

/// Where the keys begin is known when the block's last memo is.
void MemoSegmentWriter::end_memos() {
  std::size_t at = 0;
  for (const std::uint32_t size : sizes_) {
    auto head = value_at<MemoHead>(memos_.data() + at);
    head.keys_ahead += static_cast<std::uint32_t>(memos_.size() - at);
    std::memcpy(memos_.data() + at, &head, sizeof head);
    head.check = check_of(std::span(memos_).subspan(at + kCheckBytes, size - kCheckBytes));
    std::memcpy(memos_.data() + at, &head.check, kCheckBytes);
    at += size;
  }
}

bool MemoSegmentWriter::flush() {
  if (names_.empty()) return !failed_;
  end_memos();
  const auto first_new = stages_.all().begin() + static_cast<std::ptrdiff_t>(stages_written_);
  const Block block{{first_new, stages_.all().end()},
                    std::move(names_),
                    std::move(times_),
                    std::move(sizes_),
                    memos_.size() + keys_.size()};
  memos_.insert(memos_.end(), keys_.begin(), keys_.end());
  stages_written_ = stages_.all().size();
  const bool written = append(encode_artefact(block), memos_);
  names_.clear(), times_.clear(), sizes_.clear(), keys_.clear(), memos_.clear();
  return written;
}

bool MemoSegmentWriter::append(ByteSpan payload, ByteSpan body) {
  if (failed_ || !open()) return failed_ = true, false;
  Bytes bytes(kBlockHeadBytes);
  const BlockHead head{payload.size(), sha256(payload)};
  std::memcpy(bytes.data(), &head.bytes, 8);
  std::memcpy(bytes.data() + 8, head.digest.data(), 32);
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  bytes.insert(bytes.end(), body.begin(), body.end());
  failed_ = !write_all(file_.get(), bytes);
  return !failed_;
}

/// Others wait for nothing: the name is this process's own.
bool MemoSegmentWriter::open() {
  static std::atomic<unsigned> counter{0};
  if (file_.get() >= 0) return true;
  std::error_code ec;
  std::filesystem::create_directories(folder_, ec);
  constexpr int kAttempts = 100;  // a process of this number may have written here before
  for (int i = 0; i < kAttempts && file_.get() < 0; ++i) {
    path_ = folder_ + "/" + std::to_string(wall_clock_ns()) + "-" + owner_mark() + "-" +
            std::to_string(counter++) + std::string(kOpenEnding);
    file_.reset(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0666));
    if (file_.get() < 0 && errno != EEXIST) return false;
  }
  return file_.get() >= 0 && write_all(file_.get(), kMagic);
}

bool MemoSegmentWriter::finish() {
  flush();
  if (file_.get() < 0 || failed_) return file_.reset(), false;
  const bool ended = append(encode_artefact(Block{}), {});
  file_.reset();
  const std::string final_path =
      path_.substr(0, path_.size() - kOpenEnding.size()) + std::string(kFinishedEnding);
  if (!ended || ::rename(path_.c_str(), final_path.c_str()) != 0) return false;
  path_ = final_path;
  return true;
}

}  // namespace texmesh
