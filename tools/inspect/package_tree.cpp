#include "tools/inspect/package_tree.h"

#include <zlib.h>

#include <algorithm>

#include "pipeline/io/atomic_file.h"
#include "pipeline/io/new_folder.h"
#include "tools/inspect/fragment_files.h"

namespace texmesh {
namespace fs = std::filesystem;
namespace {

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
  std::vector<EntryRef> entries = package.index();
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
  const auto crc = static_cast<std::uint32_t>(crc32_z(crc32_z(0, nullptr, 0), bytes.data(), bytes.size()));
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
    for (const EntryRef& e : package_.index()) named.insert(e.path);
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

void unpack_package(const std::string& package_path, const std::string& folder,
                    const UnpackOptions& options) {
  PackageReader package(open_store(package_path));
  const Bytes manifest = manifest_bytes(package);
  NewTree tree(folder, options.force);
  tree.add(kManifestPath, manifest);
  for (const EntryRef& e : container_order(package)) tree.add(e.path, package.entry(e));
  if (const auto credential = content_credential(package.store()))
    tree.add(kContentCredentialPath, *credential);
  if (options.fragment_files) {
    const FragmentIndex index = make_fragment_files(
        package, [&](const std::string& path, const Bytes& jpeg) { tree.add(path, jpeg); });
    const std::string json = write_fragment_index(index);
    tree.add(kFragmentIndexPath, Bytes(json.begin(), json.end()));
  }
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
