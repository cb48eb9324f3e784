#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

namespace texmesh {

/// Random access to a package's bytes: a file, memory, a server.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  /// What errors call it: a file name or URL.
  virtual std::string name() const { return "package"; }
  virtual std::uint64_t size() = 0;
  /// Exactly `bytes` bytes from `offset`; throws FormatError when they are not there, InputError
  /// when reading fails.
  virtual std::vector<std::uint8_t> read(std::uint64_t offset, std::uint64_t bytes) = 0;
};
std::unique_ptr<ByteSource> open_file_source(const std::string& path);  // InputError
/// Keeps the span, not a copy.
std::unique_ptr<ByteSource> memory_source(std::span<const std::uint8_t> bytes, std::string name = "package");
/// Keeps the bytes.
std::unique_ptr<ByteSource> memory_source(std::vector<std::uint8_t>&& bytes, std::string name = "package");

struct ContainerEntry {
  std::string path;
  std::uint64_t offset = 0, bytes = 0;  // of the data
  std::uint32_t crc32 = 0;
};

/// Paths a package may hold: relative, '/'-separated, [a-z0-9._-] only, no empty, "." or ".." part, at
/// most 200 bytes; and kContentCredentialPath, whose capitals are C2PA's.
bool is_valid_entry_path(const std::string& path);

/// Writes the ISO/IEC 21320-1 profile of SPEC.md: STORE, data 64-byte aligned, dates 1980-01-01, no
/// descriptors, ZIP64 only where needed. `sink` receives the bytes in order. Throws FormatError when a path
/// is invalid, taken, or also a folder of another entry.
class ContainerWriter {
 public:
  using Sink = std::function<void(std::span<const std::uint8_t>)>;
  explicit ContainerWriter(Sink sink);
  void add(const std::string& path, std::span<const std::uint8_t> data);
  /// The same in pieces, for data that is not in memory: `produce` hands exactly `bytes` bytes of that CRC to
  /// its argument. FormatError when the count or the CRC turns out otherwise.
  void add(const std::string& path, std::uint64_t bytes, std::uint32_t crc32,
           const std::function<void(const Sink&)>& produce);
  void finish();
  const std::vector<ContainerEntry>& entries() const { return entries_; }
  /// Offset of the data of an entry that would be added next, for laying out before writing.
  static std::uint64_t data_offset(std::uint64_t local_header_offset, const std::string& path,
                                   std::uint64_t bytes);

 private:
  void write(std::span<const std::uint8_t> bytes);
  void begin(const std::string& path, std::uint64_t bytes, std::uint32_t crc32);
  Sink sink_;
  std::vector<ContainerEntry> entries_;
  std::vector<std::uint64_t> headers_;
  std::set<std::string> paths_, folders_;
  std::uint64_t at_ = 0;
};

/// Reads the central directory and checks every rule of the profile (local headers included, overlaps, gaps
/// that are not alignment, trailing bytes); FormatError otherwise. Entries in file order; their data is not
/// read.
std::vector<ContainerEntry> read_container(ByteSource& source);

/// CRC-32 of bytes, behind others that have given `before`.
std::uint32_t crc_of(std::span<const std::uint8_t> bytes, std::uint32_t before = 0);

}  // namespace texmesh
