#include "pipeline/import/archive/archive_files.h"

#include <zlib.h>

#include "format/base/text_bytes.h"
#include "pipeline/about/source_annotations.h"
#include "pipeline/about/source_fields.h"
#include "pipeline/import/text_scan.h"

namespace texmesh {

namespace {

constexpr std::uint32_t kLocalMark = 0x04034b50, kCentralMark = 0x02014b50;
constexpr std::size_t kEndBytes = 22, kEnd64Bytes = 56, kLocator64Bytes = 20, kCentralBytes = 46,
                      kLocalBytes = 30, kMaxComment = 65'535;
constexpr std::uint16_t kStored = 0, kDeflated = 8;
/// Deflate turns no byte into more.
constexpr std::uint64_t kMostPacking = 1032;
constexpr std::uint64_t kMaxDirectoryBytes = std::uint64_t{64} << 20;

/// Where the directory stands, and how many files it lists.
struct DirectoryPlace {
  std::uint64_t offset = 0, bytes = 0, count = 0;
};

[[noreturn]] void refuse_archive(ByteSource& archive, const std::string& place, const std::string& expected,
                                 const std::string& found) {
  throw InputError(archive.name(), place, expected, found);
}

Bytes part_of(ByteSource& archive, std::uint64_t offset, std::uint64_t bytes, const std::string& place) {
  const std::uint64_t size = archive.size();
  if (offset > size || bytes > size - offset)
    refuse_archive(archive, place, "a whole ZIP archive", "one that is cut, or whose directory is wrong");
  return archive.read(offset, bytes);
}

DirectoryPlace find_directory(ByteSource& archive) {
  const std::string place = "end of the archive";
  const std::uint64_t size = archive.size(),
                      tail_bytes = std::min<std::uint64_t>(size, kEndBytes + kMaxComment);
  const Bytes tail = part_of(archive, size - tail_bytes, tail_bytes, place);
  for (std::size_t at = tail.size() < kEndBytes ? 0 : tail.size() - kEndBytes + 1; at-- > 0;) {
    if (text_of(ByteSpan(tail).subspan(at, 4)) != std::string_view("PK\5\6")) continue;
    BytesIn end(ByteSpan(tail).subspan(at + 4), archive.name());
    const std::uint16_t disk = end.u16(), directory_disk = end.u16(), here = end.u16(), count = end.u16();
    DirectoryPlace out;
    out.bytes = end.u32();
    out.offset = end.u32();
    out.count = count;
    if (end.u16() > end.left()) continue;  // these four bytes stand in a comment
    if (disk != 0 || directory_disk != 0 || here != count)
      refuse_archive(archive, place, "an archive of one file", "one of several");
    const std::uint64_t end_at = size - tail_bytes + at;
    if (out.offset != 0xffffffff && out.bytes != 0xffffffff && count != 0xffff) return out;
    const Bytes locator =
        part_of(archive, end_at < kLocator64Bytes ? size : end_at - kLocator64Bytes, kLocator64Bytes, place);
    if (text_of(ByteSpan(locator).first(4)) != std::string_view("PK\6\7")) return out;
    BytesIn to(ByteSpan(locator).subspan(8), archive.name());
    const Bytes record = part_of(archive, to.u64(), kEnd64Bytes, place);
    BytesIn end64(ByteSpan(record).subspan(32), archive.name());
    out.count = end64.u64();
    out.bytes = end64.u64();
    out.offset = end64.u64();
    return out;
  }
  refuse_archive(archive, place, "a whole ZIP archive", "no directory: the archive is cut");
}

/// Sizes and the place of a file of 4 GiB and more, and the name in UTF-8 beside `name` in other bytes.
void read_extra(BytesIn extra, std::string& name, ArchivedFile& file) {
  constexpr std::uint16_t kZip64 = 1, kUnicodePath = 0x7075;
  while (extra.left() >= 4) {
    const std::uint16_t id = extra.u16(), bytes = extra.u16();
    if (bytes > extra.left()) return;
    BytesIn field(extra.raw(bytes), "");
    if (id == kUnicodePath && bytes > 5 && field.u8() == 1 && field.u32() == crc_of(text_bytes(name)))
      name = text_of(field.raw(field.left()));
    if (id != kZip64) continue;
    for (std::uint64_t* number : {&file.bytes, &file.packed_bytes, &file.header})
      if (*number == 0xffffffff && field.left() >= 8) *number = field.u64();
  }
}

/// A name that is no UTF-8, in code page 850, as programs of Windows write it. The standard's code page 437
/// has the same letters of French, German and Spanish, and frames where 850 has the other letters.
std::string oem_text(const std::string& name) {
  static constexpr char16_t kFrom0x80[] =
      u"ÇüéâäàåçêëèïîìÄÅÉæÆôöòûùÿÖÜø£Ø×ƒáíóúñÑªº¿®¬½¼¡«»░▒▓│┤ÁÂÀ©╣║╗╝¢¥┐└┴┬├─┼ãÃ╚╔╩╦╠═╬¤ðÐÊËÈıÍÎÏ┘┌█▄¦Ì▀"
      u"ÓßÔÒõÕµþÞÚÛÙýÝ¯´\u00ad±‗¾¶§÷¸°¨·¹³²■\u00a0";
  std::string text;
  for (const char byte : name) {
    const auto c = static_cast<unsigned char>(byte);
    append_utf8(text, c < 0x80 ? char32_t{c} : char32_t{kFrom0x80[c - 0x80]});
  }
  return text;
}

bool leaves_archive(const std::string& name) {
  if (name.empty() || name.front() == '/' || (name.size() > 1 && name[1] == ':')) return true;
  return std::ranges::count(pieces_of(name, '/'), "..") > 0 || name.find('\0') != name.npos;
}

std::string archived_name(const std::string& name) { return name.substr(name.rfind('/') + 1); }

bool is_addition_of_macos(const std::string& name) {
  return name.starts_with("__MACOSX/") || name.find("/__MACOSX/") != name.npos ||
         archived_name(name).starts_with("._") || archived_name(name) == ".DS_Store";
}

/// The names, with slashes. InputError for those that lead out of the archive.
void set_names(ByteSource& archive, const std::string& name, ArchivedFile& file) {
  file.name = is_utf8(name) ? name : oem_text(name);
  if (!is_utf8(name)) file.other_name = utf8_of(name);
  for (std::string* text : {&file.name, &file.other_name}) std::ranges::replace(*text, '\\', '/');
  if (leaves_archive(file.name))
    refuse_archive(archive, "directory", "names within the archive", readable_name(file.name));
}

/// The next file of the directory; one without a name is none to read.
ArchivedFile next_file(ByteSource& archive, BytesIn& in) {
  if (in.left() < kCentralBytes || in.u32() != kCentralMark)
    refuse_archive(archive, "directory", "an entry for each file", "other bytes");
  in.raw(4);
  const std::uint16_t flags = in.u16();
  ArchivedFile file;
  file.method = in.u16();
  in.raw(4);
  file.crc32 = in.u32();
  file.packed_bytes = in.u32();
  file.bytes = in.u32();
  const std::uint16_t name_bytes = in.u16(), extra = in.u16(), comment = in.u16();
  in.raw(4);
  const std::uint32_t attributes = in.u32();
  file.header = in.u32();
  if (std::uint64_t{name_bytes} + extra + comment > in.left())
    refuse_archive(archive, "directory", "an entry for each file", "one that is cut");
  std::string name(in.text(name_bytes));
  read_extra(BytesIn(in.raw(extra), ""), name, file);
  in.raw(comment);
  set_names(archive, name, file);
  constexpr std::uint16_t kEncrypted = 1 | 1 << 6 | 1 << 13;
  if (flags & kEncrypted)
    refuse_archive(archive, readable_name(file.name), "an archive without a password", "an encrypted file");
  constexpr std::uint32_t kTypeMask = 0170000, kLink = 0120000;
  file.is_link = (attributes >> 16 & kTypeMask) == kLink;
  if (file.name.ends_with('/') || is_addition_of_macos(file.name)) file.name.clear();
  return file;
}

void check_sizes(ByteSource& archive, const ArchivedFile& file, std::uint64_t& left) {
  if (file.bytes / kMostPacking > file.packed_bytes)
    refuse_archive(archive, readable_name(file.name), "a size that its packed bytes can give",
                   std::to_string(file.bytes) + " bytes of " + std::to_string(file.packed_bytes));
  if (file.bytes > left)
    refuse_archive(archive, readable_name(file.name),
                   "files within the limit of import.max_file_bytes together", "more bytes");
  left -= file.bytes;
}

/// Nothing where the packed bytes are no stream of so many bytes.
Bytes inflated(Bytes packed, std::uint64_t bytes) {
  constexpr std::size_t kStep = std::size_t{1} << 30;  // zlib counts in 32 bits
  z_stream stream{};
  if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) throw std::bad_alloc();
  Bytes out(bytes);
  std::uint8_t none = 0;
  int state = Z_OK;
  for (std::size_t from = 0, to = 0; state == Z_OK;) {
    stream.next_in = packed.data() + from;
    stream.avail_in = static_cast<uInt>(std::min(packed.size() - from, kStep));
    stream.next_out = to < out.size() ? out.data() + to : &none;
    stream.avail_out = static_cast<uInt>(std::min(out.size() - to, kStep));
    const uInt in_before = stream.avail_in, out_before = stream.avail_out;
    state = inflate(&stream, Z_NO_FLUSH);
    from += in_before - stream.avail_in;
    to += out_before - stream.avail_out;
    if (state == Z_STREAM_END && to != out.size()) state = Z_DATA_ERROR;
  }
  inflateEnd(&stream);
  if (state != Z_STREAM_END) out.clear();
  return out;
}

// Names below the folder, names of both kinds together, and names that are looked at for the second kind.
constexpr std::size_t kMostBelow = 16, kMostSimilar = 32, kMostLooked = 64;
constexpr std::uint64_t kMaxTextBytes = 65'536;

/// The file of at most so many bytes that is least deep of those whose last part, in small letters, is
/// `wanted`.
const ArchivedFile* least_deep(const ArchiveFiles& archive, std::uint64_t max_bytes, const auto& wanted) {
  const ArchivedFile* found = nullptr;
  for (const ArchivedFile& f : archive.files())
    if (!f.is_link && f.bytes <= max_bytes && wanted(lower(archived_name(f.name))) &&
        (!found || std::ranges::count(f.name, '/') < std::ranges::count(found->name, '/')))
      found = &f;
  return found;
}

/// The text of the file with this last part, in any case, that is least deep; "" without one.
std::string text_named(ArchiveFiles& archive, std::string_view last) {
  const ArchivedFile* found =
      least_deep(archive, kMaxTextBytes, [&](const std::string& name) { return name == last; });
  if (!found) return "";
  const Bytes bytes = archive.unpacked(*found, kMaxTextBytes);
  return utf8_of(text_of(bytes));
}

/// "* title:  A bust" of Sketchfab's license.txt, and the line that others shall write.
void read_licence_text(const std::string& text, About& about, Notes& notes) {
  LineReader lines(text);
  for (std::string_view line; lines.next(line);) {
    line = trim(line);
    if (line.starts_with("This work is based on"))
      set_source_field(about, "attribution", std::string(line), "license.txt", notes);
    if (!line.starts_with('*')) continue;
    line = trim(line.substr(1));
    const std::size_t colon = line.find(':');
    if (colon == line.npos) continue;
    const std::string_view name = line.substr(0, colon);
    set_source_field(about, name == "license type" ? "license" : name,
                     std::string(trim(line.substr(colon + 1))), "license.txt", notes);
  }
}

/// "WGS84 UTM 32N".
void read_coordinates(const std::string& text, About& about, Notes& notes) {
  LineReader lines(text);
  std::string_view line;
  if (!lines.next(line)) return;
  line = trim(line);
  constexpr std::string_view kUtm = "WGS84 UTM ";
  if (!line.starts_with(kUtm) || line.size() < kUtm.size() + 2) return;
  set_source_field(about, "crs", std::string(line), "coords.txt", notes);
  std::int64_t zone = 0;
  const char half = line.back();
  if (!parse_integer(line.substr(kUtm.size(), line.size() - kUtm.size() - 1), zone) || zone < 1 ||
      zone > 60 || (half != 'N' && half != 'S'))
    return;
  constexpr std::int64_t kNorth = 32600, kSouth = 32700;
  set_source_field(about, "epsg", std::to_string((half == 'N' ? kNorth : kSouth) + zone), "coords.txt",
                   notes);
}

}  // namespace

std::vector<ArchivedFile> list_archive(ByteSource& archive, std::uint64_t max_bytes) {
  const DirectoryPlace place = find_directory(archive);
  if (place.count > kMaxArchiveFiles)
    refuse_archive(archive, "directory", "at most " + std::to_string(kMaxArchiveFiles) + " files",
                   std::to_string(place.count));
  if (place.bytes > kMaxDirectoryBytes)
    refuse_archive(archive, "directory", "at most " + std::to_string(kMaxDirectoryBytes) + " bytes",
                   std::to_string(place.bytes));
  const Bytes directory = part_of(archive, place.offset, place.bytes, "directory");
  BytesIn in(directory, archive.name());
  std::vector<ArchivedFile> out;
  std::set<std::string> names;
  std::set<std::uint64_t> headers;
  std::uint64_t left = max_bytes;
  for (std::uint64_t k = 0; k < place.count; ++k) {
    ArchivedFile file = next_file(archive, in);
    if (file.name.empty()) continue;
    check_sizes(archive, file, left);
    if (!names.insert(file.name).second || !headers.insert(file.header).second)
      refuse_archive(archive, readable_name(file.name), "every file once", "twice");
    out.push_back(std::move(file));
  }
  return out;
}

std::optional<std::size_t> model_of_archive(const std::vector<ArchivedFile>& files,
                                            const std::string& archive) {
  constexpr std::string_view kEndings[] = {".gltf", ".glb", ".obj", ".ply", ".stl"};
  using Rank = std::tuple<bool, std::ptrdiff_t, std::ptrdiff_t, bool>;  // the least is the one
  const auto holds = [&](const char* name) {
    return std::ranges::find(files, name, &ArchivedFile::name) != files.end();
  };
  if (holds("manifest.json") && holds("index.bin"))
    throw InputError(archive, "", "a model", "a package of texmesh, which is compiled already");
  std::optional<std::size_t> best;
  std::optional<Rank> least;
  bool several = false;
  for (std::size_t k = 0; k < files.size(); ++k) {
    const std::string name = lower(files[k].name);
    const auto* ending = std::ranges::find(kEndings, lower_ending(name));
    if (ending == std::end(kEndings) || files[k].is_link) continue;
    const Rank rank{archived_name(name) != "scene.gltf", ending - kEndings, std::ranges::count(name, '/'),
                    name.find("odm_textured_model_geo.") == name.npos};
    several = least == rank || (several && least < rank);
    if (least && *least <= rank) continue;
    least = rank;
    best = k;
  }
  if (several)
    throw InputError(archive, "", "one model; unpack the archive to choose",
                     "several beside each other, " + readable_name(files[*best].name) + " among them");
  return best;
}

bool is_archive_of_model(const std::string& path) {
  try {
    const auto source = open_file_source(path);
    return model_of_archive(list_archive(*source, kAnyArchiveSize), path).has_value();
  } catch (const Error&) {
    return true;  // the build says what is wrong with it
  }
}

ArchiveFiles::ArchiveFiles(std::string archive, ByteSpan bytes, std::uint64_t max_bytes)
    : ArchiveFiles(memory_source(bytes, archive), max_bytes) {}

ArchiveFiles::ArchiveFiles(std::unique_ptr<ByteSource> source, std::uint64_t max_bytes)
    : archive_(source->name()), source_(std::move(source)) {
  files_ = list_archive(*source_, max_bytes);
  if (const auto k = model_of_archive(files_, archive_)) model_ = files_[*k].name;
  folder_ = model_.substr(0, model_.rfind('/') + 1);
  for (std::size_t i = 0; i < files_.size(); ++i) {
    by_name_.emplace(files_[i].name, i);
    if (files_[i].is_link) continue;
    const std::string last = archived_name(files_[i].name);
    by_last_[last].push_back(i);
    by_last_key_[similar_key(last)].push_back(i);
    if (const std::string key = key_below(files_[i]); !key.empty()) by_key_[key].push_back(i);
  }
  for (std::size_t i = 0; i < files_.size(); ++i) {  // true names first
    const std::string& other = files_[i].other_name;
    if (other.empty() || files_[i].is_link) continue;
    by_name_.emplace(other, i);
    if (const std::string last = archived_name(other); last != archived_name(files_[i].name))
      by_last_[last].push_back(i);
  }
}

Bytes ArchiveFiles::unpacked(const ArchivedFile& file, std::uint64_t max_bytes) {
  const std::string place = readable_name(file.name);
  if (file.bytes > max_bytes)
    throw InputError(archive_, place, "at most " + std::to_string(max_bytes) + " bytes",
                     std::to_string(file.bytes));
  const Bytes head = part_of(*source_, file.header, kLocalBytes, place);
  BytesIn in(head, archive_);
  if (in.u32() != kLocalMark)
    refuse_archive(*source_, place, "the file where the directory says", "other bytes");
  in.raw(22);
  const std::uint64_t name = in.u16(), extra = in.u16();
  Bytes packed = part_of(*source_, file.header + kLocalBytes + name + extra, file.packed_bytes, place);
  Bytes out;
  if (file.method == kStored)
    out = std::move(packed);
  else if (file.method == kDeflated)
    out = inflated(std::move(packed), file.bytes);
  else
    refuse_archive(*source_, place, "a file that is stored or deflated (unpack the archive first)",
                   "packing of kind " + std::to_string(file.method));
  if (out.size() != file.bytes || crc_of(out) != file.crc32)
    refuse_archive(*source_, place, "the bytes that its size and CRC-32 say",
                   "others: the archive is damaged");
  return out;
}

std::optional<Bytes> ArchiveFiles::read(const std::string& uri, std::uint64_t max_bytes) {
  bool is_link = false;
  for (const std::string& whole : {folder_ + uri, uri})
    if (const auto exact = by_name_.find(whole); exact != by_name_.end()) {
      if (!files_[exact->second].is_link) return unpacked(files_[exact->second], max_bytes);
      is_link = true;
    }
  const auto only = by_last_.find(archived_name(uri));
  if (only != by_last_.end() && only->second.size() == 1) return unpacked(files_[only->second[0]], max_bytes);
  if (is_link)
    throw FileRefused(uri, "", "a regular file", "a symbolic link; unpack the archive to follow it");
  return std::nullopt;
}

std::string ArchiveFiles::key_below(const ArchivedFile& f) const {
  return f.name.starts_with(folder_) ? similar_key(f.name.substr(folder_.size())) : "";
}

std::vector<std::string> ArchiveFiles::similar(const std::string& uri) {
  std::vector<std::string> out;
  const std::string key = similar_key(uri), asked = folder_ + uri;
  const auto is_of_key = [&](const ArchivedFile& f) { return f.name != asked && key_below(f) == key; };
  if (const auto below = by_key_.find(key); below != by_key_.end())
    for (std::size_t i = 0; i < below->second.size() && out.size() < kMostBelow; ++i)
      if (const ArchivedFile& f = files_[below->second[i]]; is_of_key(f))
        out.push_back(f.name.substr(folder_.size()));
  if (const auto named = by_last_key_.find(similar_key(archived_name(uri))); named != by_last_key_.end())
    for (std::size_t i = 0; i < std::min(named->second.size(), kMostLooked) && out.size() < kMostSimilar;
         ++i) {
      const ArchivedFile& f = files_[named->second[i]];
      const std::string last = archived_name(f.name);
      if (!is_of_key(f)) out.push_back(by_last_[last].size() == 1 ? last : f.name);
    }
  std::ranges::sort(out);
  out.erase(std::unique(out.begin(), out.end()), out.end());  // clang 14, which fuzzes, has no ranges::unique
  return out;
}

About archive_about(ArchiveFiles& archive, const std::string& model, Notes& notes) {
  About about;
  read_licence_text(text_named(archive, "license.txt"), about, notes);
  if (lower(model).find("odm_textured_model") == std::string::npos) return about;
  set_source_field(about, "unit", "metre", model, notes);
  set_source_field(about, "up axis", "z", model, notes);
  for (const char* name : {"coords.txt", "proj.txt"})
    if (about.crs.empty()) read_coordinates(text_named(archive, name), about, notes);
  return about;
}

std::optional<std::pair<std::string, Bytes>> archived_annotations(ArchiveFiles& archive) {
  const auto named = [&](const auto& wanted) { return least_deep(archive, kMaxNotesFileBytes, wanted); };
  const ArchivedFile* found = named([](const std::string& name) { return name == "annotations.json"; });
  if (!found) found = named([](const std::string& name) { return name.ends_with("svx.json"); });
  if (!found) return {};
  return std::pair(readable_name(found->name), archive.unpacked(*found, kMaxNotesFileBytes));
}

}  // namespace texmesh
