#include "tools/inspect/package_tree.h"

#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "format/rules/allocation.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/new_folder.h"

namespace texmesh {

namespace fs = std::filesystem;
namespace {

constexpr const char* kNoFile = "0000000000000000";

std::string short_digest(const Bytes& bytes) { return to_hex(sha256(bytes)).substr(0, 16); }

/// As many sizes and digests as the plane has fragments.
void check_rung_index(const FragmentIndex::Plane& plane, const FragmentIndex::Rung& rung,
                      const std::string& place) {
  const auto fail = [&](const std::string& at, const std::string& expected, const std::string& found) {
    throw FormatError(kFragmentIndexPath, at, expected, found);
  };
  const std::size_t fragments = plane.order.size();
  if (rung.bytes.size() != fragments || rung.digests.size() != fragments)
    fail(place, std::to_string(fragments) + " fragments, as in order",
         std::to_string(rung.bytes.size()) + " sizes, " + std::to_string(rung.digests.size()) + " digests");
  for (std::size_t i = 0; i < fragments; ++i)
    if (rung.digests[i].size() != 16 ||
        rung.digests[i].find_first_not_of("0123456789abcdef") != std::string::npos)
      fail(place + "/sha256/" + std::to_string(i), "16 lower-case hexadecimal digits", rung.digests[i]);
}

/// Compares the files of one rung (the one added to `streams` last) with the index and the rung's own entry.
void check_rung_files(PackageStore& folder, const std::map<std::string, std::uint64_t>& files,
                      const TextureInfo& info, const PlaneTables& t, const PlaneStreams& streams,
                      std::uint32_t plane, std::uint32_t rung, const FragmentIndex::Rung& stated,
                      Findings& findings) {
  for (std::size_t k = 0; k < t.order.size(); ++k) {
    const std::uint32_t fragment = t.order[k];
    const std::string path = fragment_file_path(plane, rung, fragment, codec_traits(info.codec).extension);
    if (streams.stream(fragment).empty()) {
      findings.require(stated.bytes[k] == 0, "fragment-file", kFragmentIndexPath, path,
                       "0 bytes, as the rung does not store it", stated.bytes[k]);
      continue;
    }
    const Bytes whole = streams.file(fragment);
    const auto file = files.find(path);
    if (!findings.require(file != files.end(), "fragment-file", path, "", "a file", "none")) continue;
    if (!findings.require_equal(whole.size(), file->second, "fragment-file", path, "bytes")) continue;
    EntryRef ref;
    ref.path = path;
    ref.bytes = whole.size();
    findings.require(folder.read(ref, 0, ref.bytes) == whole, "fragment-file", path, "",
                     "the fragment of " + info.rungs[rung].path, "other bytes");
    findings.require(stated.bytes[k] == whole.size() && stated.digests[k] == short_digest(whole),
                     "fragment-file", kFragmentIndexPath, path,
                     std::to_string(whole.size()) + " bytes, " + short_digest(whole),
                     std::to_string(stated.bytes[k]) + " bytes, " + stated.digests[k]);
  }
}

/// Cuts a package's rungs into complete files, hands each to `sink` in order of plane, rung and importance,
/// and returns their index.
using FragmentFileSink = std::function<void(const std::string& path, const std::vector<std::uint8_t>& file)>;
FragmentIndex make_fragment_files(PackageReader& package, const FragmentFileSink& sink) {
  FragmentIndex index;
  for (std::uint32_t plane = 0; plane < package.textures().size(); ++plane) {
    const PlaneTables& t = package.tables().planes[plane];
    const TextureInfo& info = package.textures()[plane];
    FragmentIndex::Plane entry{t.order, {}};
    PlaneStreams streams(info.codec, t, package.entry(info.tables));
    for (std::uint32_t rung = 0; rung < t.rung_count(); ++rung) {
      streams.add_pack(rung, package.entry(info.rungs[rung]));
      FragmentIndex::Rung files;
      for (const std::uint16_t fragment : t.order) {
        if (streams.stream(fragment).empty()) {  // not stored on this rung
          files.bytes.push_back(0);
          files.digests.push_back(kNoFile);
          continue;
        }
        const Bytes file = streams.file(fragment);
        files.bytes.push_back(file.size());
        files.digests.push_back(short_digest(file));
        sink(fragment_file_path(plane, rung, fragment, codec_traits(info.codec).extension), file);
      }
      entry.rungs.push_back(std::move(files));
    }
    index.planes.push_back(std::move(entry));
  }
  return index;
}

/// One rung's entry put together again from fragment files: each without what it shares with others.
/// FormatError when a file does not begin with the tables. `table_stream` is the rung's, or the lowest rung's
/// for an incremental codec; `read_file` gives the bytes of a path.
Bytes join_fragment_files(Codec codec, const PlaneTables& t, std::uint32_t plane, std::uint32_t rung,
                          const Bytes& table_stream,
                          const std::function<Bytes(const std::string&)>& read_file) {
  const std::size_t fragments = t.fragment_count();
  Bytes pack;
  for (const std::uint16_t fragment : t.order) {
    const std::uint32_t bytes = t.size_bytes[rung * fragments + fragment];
    if (bytes == 0) continue;
    const std::string path = fragment_file_path(plane, rung, fragment, codec_traits(codec).extension);
    try {
      const Bytes stream =
          split_fragment(codec, table_stream, read_file(path), bytes_to_show(t, rung, fragment) - bytes);
      pack.insert(pack.end(), stream.begin(), stream.end());
    } catch (const FormatError& e) {
      throw FormatError(path, e.place(), e.expected(), e.found());
    }
  }
  return pack;
}

bool holds_unpacked_package(const fs::path& folder) {
  return fs::is_regular_file(fs::symlink_status(folder / kManifestPath));
}

/// A folder for a package's entries.
class NewTree {
 public:
  NewTree(const std::string& folder, bool force)
      : folder_(folder, {force, holds_unpacked_package,
                         "an empty folder, or nothing yet (--force replaces an unpacked package)",
                         "an unpacked package, the only thing that --force replaces"}) {}
  void add(const std::string& path, const Bytes& bytes) {
    if (!is_valid_entry_path(path))
      throw FormatError("package", path, "a path of the package format", "another");
    folder_.add(path, bytes);
  }
  void publish() { folder_.publish(); }

 private:
  NewFolder folder_;
};

/// Everything behind the manifest that belongs into the container, in order: what the index names, and
/// itself.
std::vector<EntryRef> container_order(PackageReader& package) {
  std::vector<EntryRef> entries = package.entries();
  entries.push_back(package.manifest().index);
  std::sort(entries.begin(), entries.end(),
            [](const EntryRef& a, const EntryRef& b) { return a.offset < b.offset; });
  return entries;
}

Bytes manifest_bytes(PackageReader& package) {
  Bytes bytes = package.store().read_manifest();
  if (sha256(bytes) != package.id())
    throw FormatError(package.store().name(), kManifestPath, "a package that does not change meanwhile",
                      "other bytes");
  return bytes;
}

/// The C2PA manifest store, which no index names and no digest covers: only the container's CRC-32 does.
std::optional<Bytes> content_credential(PackageStore& store) {
  std::vector<ContainerEntry> listed;
  try {
    listed = store.list();
  } catch (const InputError&) {
    return std::nullopt;  // files of a web server have no list
  }
  const auto it = std::ranges::find(listed, std::string(kContentCredentialPath), &ContainerEntry::path);
  if (it == listed.end()) return std::nullopt;
  if (it->bytes > kMaxContentCredentialBytes)
    throw FormatError(it->path, "", "at most " + std::to_string(kMaxContentCredentialBytes) + " bytes",
                      std::to_string(it->bytes));
  Bytes bytes = store.read({it->path, it->offset, it->bytes, {}}, 0, it->bytes);
  const std::uint32_t crc = crc_of(bytes);
  if (!store.is_folder() && crc != it->crc32)
    throw FormatError(it->path, "CRC-32", std::to_string(it->crc32), std::to_string(crc));
  return bytes;
}

/// Reads the files of a tree, as many as there are and no more.
class TreeFiles {
 public:
  explicit TreeFiles(PackageReader& package) : package_(package) {
    for (const ContainerEntry& e : package.store().list()) sizes_[e.path] = e.bytes;
    check_names();
  }

  Bytes entry(const EntryRef& ref) {
    if (sizes_.count(ref.path)) return package_.entry(ref);
    const EntryName name = parse_entry_path(ref.path);
    if (name.kind != EntryKind::kRung) throw FormatError(ref.path, "", "a file of the tree", "none");
    const Codec codec = package_.textures().at(name.number).codec;
    const std::uint32_t tables_of = codec_traits(codec).incremental ? 0 : name.rung;
    Bytes bytes = join_fragment_files(codec, package_.tables().planes.at(name.number), name.number, name.rung,
                                      package_.table_stream(name.number, tables_of),
                                      [&](const std::string& path) { return file(path); });
    if (sha256(bytes) != ref.digest)
      throw FormatError(ref.path, "", "fragment files that make " + to_hex(ref.digest),
                        to_hex(sha256(bytes)));
    return bytes;
  }

 private:
  Bytes file(const std::string& path) {
    const auto it = sizes_.find(path);
    if (it == sizes_.end()) throw FormatError(path, "", "a file of the tree", "none");
    EntryRef ref;
    ref.path = path;
    ref.bytes = it->second;
    return package_.store().read(ref, 0, ref.bytes);
  }

  void check_names() {
    std::set<std::string> named{kManifestPath, kIndexPath, kFragmentIndexPath, kContentCredentialPath};
    for (const EntryRef& e : package_.entries()) named.insert(e.path);
    for (const auto& [path, bytes] : sizes_)
      if (!named.count(path) && parse_entry_path(path).kind != EntryKind::kFragmentFile)
        throw FormatError(path, "", "a file that the package's index names", "another");
  }

  PackageReader& package_;
  std::map<std::string, std::uint64_t> sizes_;
};

void check_offset(const ContainerEntry& written, const EntryRef& stated) {
  if (written.offset != stated.offset)
    throw FormatError(stated.path, "offset", std::to_string(stated.offset) + ", as the index says",
                      std::to_string(written.offset));
}

}  // namespace

FragmentIndex read_fragment_index(std::span<const std::uint8_t> json) {
  FragmentIndex index;
  try {
    index = from_json<FragmentIndex>(parse_bounded_json(json, kFragmentIndexPath, 16), kFragmentIndexPath);
  } catch (const InputError& e) {  // the package is to blame
    throw FormatError(e.file(), e.place(), e.expected(), e.found());
  }
  for (std::size_t k = 0; k < index.planes.size(); ++k)
    for (std::size_t r = 0; r < index.planes[k].rungs.size(); ++r)
      check_rung_index(index.planes[k], index.planes[k].rungs[r],
                       "/planes/" + std::to_string(k) + "/rungs/" + std::to_string(r));
  return index;
}

void check_fragment_files(PackageStore& folder, const std::vector<ContainerEntry>& listed,
                          const std::vector<TextureInfo>& textures, const PackageTables& tables,
                          Findings& findings) {
  std::map<std::string, std::uint64_t> files;
  EntryRef index_ref;
  index_ref.path = kFragmentIndexPath;
  for (const ContainerEntry& e : listed) {
    if (e.path == kFragmentIndexPath) index_ref.bytes = e.bytes;
    const EntryName name = parse_entry_path(e.path);
    if (name.kind != EntryKind::kFragmentFile) continue;
    files[e.path] = e.bytes;
    const bool known = name.number < tables.planes.size() &&
                       name.rung < tables.planes[name.number].rung_count() &&
                       name.extension == codec_traits(textures[name.number].codec).extension &&
                       std::count(tables.planes[name.number].order.begin(),
                                  tables.planes[name.number].order.end(), name.fragment) > 0;
    findings.require(known, "fragment-file", e.path, "", "a stored fragment of the package",
                     "none of that name");
  }
  const FragmentIndex index = read_fragment_index(folder.read(index_ref, 0, index_ref.bytes));
  if (index.planes.empty() && files.empty()) return;
  if (!findings.require_equal(tables.planes.size(), index.planes.size(), "fragment-file", kFragmentIndexPath,
                              "/planes"))
    return;
  for (std::uint32_t plane = 0; plane < tables.planes.size(); ++plane) {
    const PlaneTables& t = tables.planes[plane];
    const std::string place = "/planes/" + std::to_string(plane);
    if (!findings.require(
            index.planes[plane].order == t.order && index.planes[plane].rungs.size() == t.rung_count(),
            "fragment-file", kFragmentIndexPath, place, "order and rungs as in the tables", "others"))
      continue;
    const TextureInfo& info = textures[plane];
    PlaneStreams streams(info.codec, t, folder.read(info.tables, 0, info.tables.bytes));
    for (std::uint32_t rung = 0; rung < t.rung_count(); ++rung) {
      streams.add_pack(rung, folder.read(info.rungs[rung], 0, info.rungs[rung].bytes));
      check_rung_files(folder, files, info, t, streams, plane, rung, index.planes[plane].rungs[rung],
                       findings);
    }
  }
}

void unpack_package(const std::string& package_path, const std::string& folder,
                    const UnpackOptions& options) {
  PackageReader package(open_store(package_path));
  const Bytes manifest = manifest_bytes(package);
  NewTree tree(folder, options.force);
  tree.add(kManifestPath, manifest);
  for (const EntryRef& e : container_order(package)) tree.add(e.path, package.entry(e));
  if (const auto credential = content_credential(package.store()))
    tree.add(kContentCredentialPath, *credential);
  FragmentIndex index;
  if (options.fragment_files)
    index = make_fragment_files(package,
                                [&](const std::string& path, const Bytes& jpeg) { tree.add(path, jpeg); });
  const std::string json = to_json_line(index);
  tree.add(kFragmentIndexPath, Bytes(json.begin(), json.end()));
  tree.publish();
}

void pack_folder(const std::string& folder, const std::string& package_path) {
  PackageReader package(open_folder(folder));
  TreeFiles files(package);
  Bytes container;
  ContainerWriter writer([&](std::span<const std::uint8_t> bytes) {
    container.insert(container.end(), bytes.begin(), bytes.end());
  });
  writer.add(kManifestPath, manifest_bytes(package));
  const std::vector<EntryRef> order = container_order(package);
  for (const EntryRef& e : order) {
    writer.add(e.path, files.entry(e));
    check_offset(writer.entries().back(), e);
  }
  if (const auto credential = content_credential(package.store()))
    writer.add(kContentCredentialPath, *credential);
  writer.finish();
  write_output_file(package_path, container);
}

}  // namespace texmesh
