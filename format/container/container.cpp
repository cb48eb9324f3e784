#include "format/container/container.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <zlib.h>

#include <algorithm>

#include "format/base/descriptor.h"
#include "format/base/text_bytes.h"
#include "format/container/layout.h"

namespace texmesh {
namespace {

class FileSource final : public ByteSource {
 public:
  explicit FileSource(std::string path) : path_(std::move(path)) {
    // Non-blocking, so that a FIFO does not hang us before fstat can tell.
    fd_.reset(::open(path_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
    if (fd_.get() < 0)
      throw InputError(path_, "", "", std::string("cannot be read: ") + std::strerror(errno));
    struct stat st {};
    if (::fstat(fd_.get(), &st) != 0 || !S_ISREG(st.st_mode))
      throw InputError(path_, "", "a regular file", "something else");
    size_ = static_cast<std::uint64_t>(st.st_size);
  }
  std::string name() const override { return path_; }
  std::uint64_t size() override { return size_; }
  Bytes read(std::uint64_t offset, std::uint64_t bytes) override {
    if (offset > size_ || bytes > size_ - offset)
      throw RuleError("K01", path_, "byte " + std::to_string(offset), std::to_string(bytes) + " bytes",
                      "a file of " + std::to_string(size_) + " bytes, which is cut off or damaged");
    Bytes out(static_cast<std::size_t>(bytes));
    if (read_at(fd_.get(), offset, out)) return out;
    if (errno == 0)
      throw RuleError("K01", path_, "byte " + std::to_string(offset), "more bytes",
                      "the file became shorter");
    throw InputError(path_, "byte " + std::to_string(offset), "",
                     std::string("cannot be read: ") + std::strerror(errno));
  }

 private:
  std::string path_;
  Descriptor fd_;
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

constexpr std::uint64_t kAlignment = 64;
constexpr std::uint64_t kMax16 = 0xffff, kMax32 = 0xffffffff;  // also what says "see ZIP64"
constexpr std::uint16_t kDate1980 = 0x0021;
constexpr std::uint16_t kZip64Extra = 0x0001;
// The id that Android's zipalign uses for the same purpose: u16 alignment, then zeros.
constexpr std::uint16_t kAlignmentExtra = 0xd935;
constexpr std::size_t kLocalFixed = 30, kCentralFixed = 46, kEndFixed = 22, kZip64TailFixed = 56 + 20;
constexpr std::size_t kLargestCentral = kCentralFixed + 200 + 28;

bool needs_zip64(std::uint64_t value) { return value >= kMax32; }

/// How long the alignment record is, so that what follows `end` + record is aligned. A record cannot be
/// shorter than its own 6 bytes, so a gap of 1 to 5 grows by one unit.
std::uint64_t alignment_record_bytes(std::uint64_t end) {
  const std::uint64_t gap = (kAlignment - end % kAlignment) % kAlignment;
  return gap == 0 || gap >= 6 ? gap : gap + kAlignment;
}

Bytes local_header(const ContainerEntry& e, std::uint64_t offset) {
  const bool zip64 = needs_zip64(e.bytes);
  const std::uint64_t zip64_bytes = zip64 ? 20 : 0;
  const std::uint64_t pad = alignment_record_bytes(offset + kLocalFixed + e.path.size() + zip64_bytes);
  BytesOut out;
  out.u32(0x04034b50);
  out.u16(zip64 ? 45 : 10);  // version needed
  out.u16(0);                // flags
  out.u16(0);                // stored
  out.u16(0);                // time
  out.u16(kDate1980);
  out.u32(e.crc32);
  out.u32(zip64 ? kMax32 : e.bytes);  // compressed
  out.u32(zip64 ? kMax32 : e.bytes);  // uncompressed
  out.u16(e.path.size());
  out.u16(zip64_bytes + pad);
  out.text(e.path);
  if (zip64) {
    out.u16(kZip64Extra);
    out.u16(16);
    out.u64(e.bytes);
    out.u64(e.bytes);
  }
  if (pad > 0) {
    out.u16(kAlignmentExtra);
    out.u16(pad - 4);
    out.u16(kAlignment);
    for (std::uint64_t i = 6; i < pad; ++i) out.u8(0);
  }
  return out.finish();
}

Bytes central_header(const ContainerEntry& e, std::uint64_t header_offset) {
  const bool big = needs_zip64(e.bytes), far = needs_zip64(header_offset);
  BytesOut out;
  out.u32(0x02014b50);
  out.u16(big || far ? 45 : 10);  // made by: MS-DOS attributes, which have no symbolic links
  out.u16(big || far ? 45 : 10);
  out.u16(0);
  out.u16(0);
  out.u16(0);
  out.u16(kDate1980);
  out.u32(e.crc32);
  out.u32(big ? kMax32 : e.bytes);
  out.u32(big ? kMax32 : e.bytes);
  out.u16(e.path.size());
  out.u16((big || far ? 4u : 0u) + (big ? 16u : 0u) + (far ? 8u : 0u));
  out.u16(0);  // comment
  out.u16(0);  // disk
  out.u16(0);  // internal attributes
  out.u32(0);  // external attributes
  out.u32(far ? kMax32 : header_offset);
  out.text(e.path);
  if (big || far) {
    out.u16(kZip64Extra);
    out.u16((big ? 16u : 0u) + (far ? 8u : 0u));
    if (big) {
      out.u64(e.bytes);
      out.u64(e.bytes);
    }
    if (far) out.u64(header_offset);
  }
  return out.finish();
}

/// End of central directory, with the ZIP64 record and locator where a number does not fit.
Bytes tail(std::uint64_t count, std::uint64_t directory_bytes, std::uint64_t directory_offset) {
  const bool zip64 = count >= kMax16 || needs_zip64(directory_bytes) || needs_zip64(directory_offset);
  BytesOut out;
  if (zip64) {
    out.u32(0x06064b50);
    out.u64(44);
    out.u16(45);
    out.u16(45);
    out.u32(0);
    out.u32(0);
    out.u64(count);
    out.u64(count);
    out.u64(directory_bytes);
    out.u64(directory_offset);
    out.u32(0x07064b50);
    out.u32(0);
    out.u64(directory_offset + directory_bytes);
    out.u32(1);
  }
  out.u32(0x06054b50);
  out.u16(0);
  out.u16(0);
  out.u16(std::min(count, kMax16));
  out.u16(std::min(count, kMax16));
  out.u32(std::min(directory_bytes, kMax32));
  out.u32(std::min(directory_offset, kMax32));
  out.u16(0);
  return out.finish();
}

struct Field {
  std::size_t at;
  const char* name;
  const char* rule = "K02";
};
constexpr Field kLocalFields[] = {{0, "signature"},
                                  {4, "version needed", "K09"},
                                  {6, "flags"},
                                  {8, "method (stored)"},
                                  {10, "time"},
                                  {12, "date (1980-01-01)"},
                                  {14, "CRC-32", "K07"},
                                  {18, "size", "K07"},
                                  {26, "name length"},
                                  {28, "extra field length", "K04"},
                                  {30, "name and extra fields", "K04"}};
constexpr Field kCentralFields[] = {{0, "signature"},
                                    {4, "version made by", "K09"},
                                    {5, "host of version made by"},
                                    {6, "version needed", "K09"},
                                    {8, "flags"},
                                    {10, "method (stored)"},
                                    {12, "time"},
                                    {14, "date (1980-01-01)"},
                                    {16, "CRC-32", "K07"},
                                    {20, "size", "K07"},
                                    {28, "name length"},
                                    {30, "extra field length", "K08"},
                                    {32, "comment length"},
                                    {34, "disk"},
                                    {36, "attributes"},
                                    {42, "offset of the local header", "K01"},
                                    {46, "name and extra fields", "K08"}};
constexpr Field kTailFields[] = {{0, "end of the central directory", "K01"}};
constexpr Field kZip64TailFields[] = {{0, "ZIP64 end of the central directory", "K10"}};

/// The profile leaves no freedom: once path, size, CRC and offset are known, every byte of a header is.
void require_same(std::span<const std::uint8_t> found, const Bytes& expected, std::span<const Field> fields,
                  const std::string& file, const std::string& place) {
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (i < found.size() && found[i] == expected[i]) continue;
    const Field* field = &fields.front();
    for (const Field& f : fields)
      if (f.at <= i) field = &f;
    throw RuleError(field->rule, file, place + ", " + field->name + " (byte " + std::to_string(i) + ")",
                    std::to_string(expected[i]),
                    i < found.size() ? std::to_string(found[i]) : std::string("the end"));
  }
}

/// The local header at byte `at`. Lengths that move the data off their place are named as that.
void require_local_header(const Bytes& found, const Bytes& expected, std::uint64_t at,
                          const std::string& file, const std::string& path) {
  const std::string place = "local header of " + path;
  BytesIn in(found, place);
  in.raw(26);
  const std::uint64_t name = in.u16(), extra = in.u16(), data = at + kLocalFixed + name + extra;
  if (data % kAlignment != 0)
    throw RuleError("K03", file, place, "data at a multiple of 64", "data at byte " + std::to_string(data));
  require_same(found, expected, kLocalFields, file, place);
}

struct Directory {
  std::uint64_t count = 0, bytes = 0, offset = 0;
};

Directory read_tail(ByteSource& source) {
  const std::uint64_t size = source.size();
  const std::uint64_t tail_bytes = std::min<std::uint64_t>(size, kZip64TailFixed + kEndFixed);
  const Bytes bytes = source.read(size - tail_bytes, tail_bytes);
  const std::string place = "end of central directory";
  if (bytes.size() < kEndFixed)
    throw RuleError("K01", source.name(), place, "a ZIP file", std::to_string(size) + " bytes");
  BytesIn end{std::span(bytes).last(kEndFixed), source.name() + ": " + place};
  under_rule("K01", [&] {
    end.expect("a ZIP end record without comment as the last 22 bytes (a file that is cut off has none)",
               std::string_view("PK\5\6\0\0\0\0", 8));
  });
  Directory d;
  end.u16();
  d.count = end.u16();
  d.bytes = end.u32();
  d.offset = end.u32();
  const bool zip64 = d.count == kMax16 || d.bytes == kMax32 || d.offset == kMax32;
  if (zip64) {
    if (bytes.size() < kZip64TailFixed + kEndFixed)
      throw RuleError("K10", source.name(), place, "a ZIP64 record", "too few bytes");
    BytesIn record(bytes, source.name() + ": ZIP64 end of central directory");
    record.raw(32);
    d.count = record.u64();
    d.bytes = record.u64();
    d.offset = record.u64();
  }
  const Bytes expected = tail(d.count, d.bytes, d.offset);
  require_same(std::span(bytes).last(std::min(bytes.size(), expected.size())), expected,
               zip64 ? kZip64TailFields : kTailFields, source.name(), place);
  if (d.offset > size || d.bytes > size - d.offset || size - d.offset - d.bytes != expected.size())
    throw RuleError("K01", source.name(), place, "a directory that ends where this record begins",
                    "offset " + std::to_string(d.offset) + ", " + std::to_string(d.bytes) + " bytes");
  if (d.count > d.bytes / (kCentralFixed + 1) || d.bytes > d.count * kLargestCentral)
    throw RuleError("K01", source.name(), place, "an entry count that fits the directory",
                    std::to_string(d.count));
  return d;
}

/// Path, size, CRC and header offset of the directory's next entry; everything else is left to require_same.
ContainerEntry read_central(BytesIn& in, std::uint64_t& header_offset) {
  ContainerEntry e;
  in.raw(16);
  e.crc32 = in.u32();
  in.u32();
  e.bytes = in.u32();
  const std::uint16_t path_bytes = in.u16(), extra_bytes = in.u16();
  in.raw(10);
  header_offset = in.u32();
  e.path = in.text(path_bytes);
  BytesIn extra(in.raw(extra_bytes), "extra field of " + e.path);
  under_rule("K08", [&] {
    if (e.bytes != kMax32 && header_offset != kMax32) return;
    extra.raw(4);
    if (e.bytes == kMax32) {
      e.bytes = extra.u64();
      extra.u64();
    }
    if (header_offset == kMax32) header_offset = extra.u64();
  });
  return e;
}

void claim_path(const std::string& path, std::set<std::string>& paths, std::set<std::string>& folders,
                const std::string& file) {
  if (!is_valid_entry_path(path)) {
    std::string shown;
    for (char c : path.substr(0, 60)) shown += c >= ' ' && c <= '~' ? c : '?';
    throw RuleError("K05", file, "entry '" + shown + "'",
                    "a relative path of a-z 0-9 . _ -, at most 200 bytes", "another");
  }
  if (paths.contains(kContentCredentialPath))
    throw RuleError("E04", file, "entry " + path, "nothing behind the content credential", "another entry");
  if (folders.contains(path))
    throw RuleError("K06", file, "entry " + path, "a file", "also a folder of other entries");
  for (std::size_t at = path.find('/'); at != std::string::npos; at = path.find('/', at + 1)) {
    const std::string folder = path.substr(0, at);
    if (paths.contains(folder))
      throw RuleError("K06", file, "entry " + path, "a free path", folder + " is a file");
    folders.insert(folder);
  }
  if (!paths.insert(path).second)
    throw RuleError("K06", file, "entry " + path, "one entry of that path", "two");
}

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

bool is_valid_entry_path(const std::string& path) {
  if (path == kContentCredentialPath) return true;
  if (path.empty() || path.size() > 200) return false;
  for (const std::string_view part : pieces_of(path, '/'))
    if (part.empty() || part == "." || part == "..") return false;
  return std::ranges::all_of(path, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '.' || c == '_' || c == '-' || c == '/';
  });
}

ContainerWriter::ContainerWriter(Sink sink) : sink_(std::move(sink)) {}

void ContainerWriter::write(std::span<const std::uint8_t> bytes) {
  if (!bytes.empty()) sink_(bytes);
  at_ += bytes.size();
}

void ContainerWriter::begin(const std::string& path, std::uint64_t bytes, std::uint32_t crc32) {
  claim_path(path, paths_, folders_, "package");
  const Bytes header = local_header({path, 0, bytes, crc32}, at_);
  headers_.push_back(at_);
  write(header);
  entries_.push_back({path, at_, bytes, crc32});
}

void ContainerWriter::add(const std::string& path, std::span<const std::uint8_t> data) {
  begin(path, data.size(), crc_of(data));
  write(data);
}

void ContainerWriter::add(const std::string& path, std::uint64_t bytes, std::uint32_t crc32,
                          const std::function<void(const Sink&)>& produce) {
  begin(path, bytes, crc32);
  const std::uint64_t start = at_;
  std::uint32_t crc = 0;
  produce([&](std::span<const std::uint8_t> part) {
    crc = crc_of(part, crc);
    write(part);
  });
  if (at_ - start != bytes)
    throw FormatError("package", "entry " + path, std::to_string(bytes) + " bytes",
                      std::to_string(at_ - start));
  if (crc != crc32) throw FormatError("package", "entry " + path, "data of the CRC-32 given", "other data");
}

void ContainerWriter::finish() {
  const std::uint64_t directory_offset = at_;
  for (std::size_t i = 0; i < entries_.size(); ++i) write(central_header(entries_[i], headers_[i]));
  write(tail(entries_.size(), at_ - directory_offset, directory_offset));
}

std::uint64_t ContainerWriter::data_offset(std::uint64_t local_header_offset, const std::string& path,
                                           std::uint64_t bytes) {
  const std::uint64_t end = local_header_offset + kLocalFixed + path.size() + (needs_zip64(bytes) ? 20 : 0);
  return end + alignment_record_bytes(end);
}

std::vector<ContainerEntry> read_container(ByteSource& source) {
  const Directory directory = read_tail(source);
  const Bytes bytes = source.read(directory.offset, directory.bytes);
  BytesIn in(bytes, source.name() + ": central directory");
  std::vector<ContainerEntry> entries;
  entries.reserve(static_cast<std::size_t>(directory.count));
  std::set<std::string> paths, folders;
  std::uint64_t at = 0;  // where the next local header must be: entries follow each other without gaps
  for (std::uint64_t i = 0; i < directory.count; ++i) {
    const std::size_t begin = in.at();
    std::uint64_t header_offset = 0;
    ContainerEntry e = under_rule("K01", [&] { return read_central(in, header_offset); });
    claim_path(e.path, paths, folders, source.name());
    const Bytes expected = central_header(e, header_offset);
    if (in.at() - begin != expected.size())
      throw RuleError("K08", source.name(), "central directory, entry " + e.path,
                      std::to_string(expected.size()) + " bytes", std::to_string(in.at() - begin));
    require_same(std::span(bytes).subspan(begin, in.at() - begin), expected, kCentralFields, source.name(),
                 "central directory, entry " + e.path);
    if (header_offset != at)
      throw RuleError("K01", source.name(), "entry " + e.path,
                      "its local header at byte " + std::to_string(at), std::to_string(header_offset));
    const Bytes header = local_header(e, at);
    if (header.size() > directory.offset - at || e.bytes > directory.offset - at - header.size())
      throw RuleError("K01", source.name(), "entry " + e.path, "data before the central directory",
                      std::to_string(e.bytes) + " bytes");
    require_local_header(source.read(at, header.size()), header, at, source.name(), e.path);
    e.offset = at + header.size();
    at = e.offset + e.bytes;
    entries.push_back(std::move(e));
  }
  under_rule("K01", [&] { in.finish(); });
  if (at != directory.offset)
    throw RuleError("K01", source.name(), "byte " + std::to_string(at), "the central directory",
                    std::to_string(directory.offset - at) + " bytes of no entry");
  return entries;
}

std::uint32_t crc_of(std::span<const std::uint8_t> bytes, std::uint32_t before) {
  if (bytes.empty()) return before;  // zlib takes a null pointer as a request to start over
  return static_cast<std::uint32_t>(::crc32_z(before, bytes.data(), bytes.size()));
}

}  // namespace texmesh
