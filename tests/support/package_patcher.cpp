#include <zlib.h>

#include <algorithm>
#include <stdexcept>

#include "format/container/container.h"
#include "format/container/layout.h"
#include "format/documents/index.h"
#include "tests/support/packages.h"

namespace texmesh::testing {
namespace {

std::uint32_t read_u32(const Bytes& b, std::size_t at) {
  return static_cast<std::uint32_t>(b[at] | b[at + 1] << 8 | b[at + 2] << 16) |
         static_cast<std::uint32_t>(b[at + 3]) << 24;
}

void set_u32(Bytes& b, std::size_t at, std::uint32_t v) {
  for (std::size_t k = 0; k < 4; ++k) b[at + k] = static_cast<std::uint8_t>(v >> (8 * k));
}

ContainerEntry find_entry(const Bytes& package, const std::string& path) {
  const auto source = memory_source(package);
  for (const ContainerEntry& e : read_container(*source))
    if (e.path == path) return e;
  throw std::runtime_error("no entry " + path);
}

}  // namespace

PackagePatcher::PackagePatcher(Bytes package) : package_(std::move(package)) {
  manifest_ = read_manifest(entry(kManifestPath));
}

Bytes PackagePatcher::entry(const std::string& path) const {
  const ContainerEntry e = find_entry(package_, path);
  const auto begin = package_.begin() + static_cast<std::ptrdiff_t>(e.offset);
  return {begin, begin + static_cast<std::ptrdiff_t>(e.bytes)};
}

PackagePatcher& PackagePatcher::patch(const std::string& path, const Bytes& bytes) {
  const ContainerEntry e = find_entry(package_, path);
  if (bytes.size() != e.bytes) throw std::runtime_error(path + ": another size");
  const auto crc = static_cast<std::uint32_t>(crc32_z(0, bytes.data(), bytes.size()));
  std::copy(bytes.begin(), bytes.end(), package_.begin() + static_cast<std::ptrdiff_t>(e.offset));
  std::size_t at = read_u32(package_, package_.size() - 6);  // of the central directory
  while (std::string(package_.begin() + static_cast<std::ptrdiff_t>(at + 46),
                     package_.begin() + static_cast<std::ptrdiff_t>(at + 46 + path.size())) != path ||
         package_[at + 28] != path.size())
    at += 46u + package_[at + 28] + package_[at + 30] + package_[at + 32];
  set_u32(package_, at + 16, crc);
  set_u32(package_, read_u32(package_, at + 42) + 14, crc);
  return *this;
}

PackagePatcher& PackagePatcher::edit(const std::string& path, const std::function<void(Bytes&)>& change) {
  Bytes bytes = entry(path);
  change(bytes);
  return patch(path, bytes);
}

void PackagePatcher::write_manifest_entry(Manifest m) {
  std::string json = write_manifest(m);
  const std::size_t room = entry(kManifestPath).size();
  if (json.size() > room) throw std::runtime_error("the manifest grew");
  json.resize(room, ' ');  // blanks after the JSON are allowed
  patch(kManifestPath, Bytes(json.begin(), json.end()));
}

PackagePatcher& PackagePatcher::seal_index(const std::function<void(std::vector<EntryRef>&)>& change) {
  Manifest m = manifest_;
  std::vector<EntryRef> index = read_index(entry(kIndexPath));
  for (EntryRef& e : index) e.digest = sha256(entry(e.path));
  for (EntryRef* ref :
       std::initializer_list<EntryRef*>{&m.textures, &m.quality, &m.provenance, &m.about, &m.tables})
    ref->digest = sha256(entry(ref->path));
  for (ManifestScale& s : m.scales)
    if (s.has_glb()) s.glb.digest = sha256(entry(s.glb.path));
  for (ManifestProxy& proxy : m.proxies) proxy.glb.digest = sha256(entry(proxy.glb.path));
  if (m.thesis) m.thesis->digest = sha256(entry(kThesisPath));
  if (change) change(index);
  Bytes written = write_index(index);
  patch(kIndexPath, written);
  m.index.digest = sha256(written);
  m.index.head_digest = sha256(std::span(written).first(static_cast<std::size_t>(m.index.head_bytes)));
  const Bytes tables = entry(kTablesPath);
  m.tables.head_digest = sha256(std::span(tables).first(static_cast<std::size_t>(m.tables.head_bytes)));
  write_manifest_entry(m);
  manifest_ = m;
  return *this;
}

PackagePatcher& PackagePatcher::seal(const std::function<void(Manifest&)>& change) {
  seal_index({});
  if (!change) return *this;
  change(manifest_);
  write_manifest_entry(manifest_);
  return *this;
}

}  // namespace texmesh::testing
