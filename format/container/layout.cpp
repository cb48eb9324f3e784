#include "format/container/layout.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <tuple>

namespace texmesh {
namespace {

template <class... T>
std::string print(const char* format, T... values) {
  char text[64];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

/// Which of the coarse places of the order an entry has.
enum Place : int {
  kManifestPlace,
  kFirstPicture,
  kIndexPlace,
  kTexturesPlace,
  kQualityPlace,
  kTableStreamsPlace,
  kTablesPlace,
  kCoarsestMesh,  // behind the tables where a proxy is the first picture
  kProxies,
  kPosterPlace,
  kAboutPlace,
  kPreviews,
  kInterleaved,
  kOthers,
  kLast,
  kGltfFiles,  // clients of a package do not read them
  kBehindAll
};

/// A kind of entry: its path as it is printed, with the numbers of EntryName in their order and without an
/// extension that varies, and its place. The first picture has another place than others of its kind.
struct KindOfEntry {
  EntryKind kind;
  const char* path;
  Place place;
  std::span<const std::string_view> extensions = {};
};
constexpr std::string_view kFragmentExtensions[] = {"jpg", "webp"};
constexpr KindOfEntry kKindsOfEntries[] = {
    {EntryKind::kManifest, kManifestPath, kManifestPlace},
    {EntryKind::kIndex, kIndexPath, kIndexPlace},
    {EntryKind::kTables, kTablesPath, kTablesPlace},
    {EntryKind::kTextures, kTexturesPath, kTexturesPlace},
    {EntryKind::kQuality, kQualityPath, kQualityPlace},
    {EntryKind::kProvenance, kProvenancePath, kLast},
    {EntryKind::kSplitStream, kSplitStreamPath, kInterleaved},
    {EntryKind::kPoster, kPosterPath, kPosterPlace},
    {EntryKind::kThesis, kThesisPath, kOthers},
    {EntryKind::kAnnotations, kAnnotationsPath, kOthers},
    {EntryKind::kAbout, kAboutPath, kAboutPlace},
    {EntryKind::kContentCredential, kContentCredentialPath, kBehindAll},
    {EntryKind::kGltfIndex, kGltfIndexPath, kGltfFiles},
    {EntryKind::kGltfScale, "gltf/s%02u.glb", kGltfFiles},
    {EntryKind::kGltfImage, "gltf/%03u-r%02u.jpg", kGltfFiles},
    {EntryKind::kMesh, "mesh/s%02u.glb", kInterleaved},
    {EntryKind::kProxy, "proxies/%02u.glb", kProxies},
    {EntryKind::kPreview, "preview/%03u.jpg", kPreviews},
    {EntryKind::kTableStreams, "texture/%u/tables.pack", kTableStreamsPlace},
    {EntryKind::kRung, "texture/%u/r%02u.pack", kInterleaved},
    {EntryKind::kFragmentFile, "texture/%u/r%02u/%04u.", kOthers, kFragmentExtensions},
    {EntryKind::kSource, "source/%03u.", kOthers, kSourceExtensions}};

const KindOfEntry& row_of(EntryKind kind) {
  return *std::ranges::find(kKindsOfEntries, kind, &KindOfEntry::kind);
}
std::string spell(EntryKind kind, std::uint32_t number, std::uint32_t rung = 0, std::uint32_t fragment = 0) {
  return print(row_of(kind).path, number, rung, fragment);
}

/// Whether a path is of this kind, however its numbers are written; fills in what the path says.
bool is_of_kind(std::string_view text, const KindOfEntry& kind, EntryName& name) {
  const std::array numbers{&name.number, &name.rung, &name.fragment};
  std::size_t seen = 0;
  for (const char* p = kind.path; *p != '\0'; ++p) {
    if (*p != '%') {
      if (!text.starts_with(*p)) return false;
      text.remove_prefix(1);
      continue;
    }
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *numbers[seen++]);
    if (error != std::errc() || end == text.data()) return false;
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    p = std::strchr(p, 'u');
  }
  if (kind.extensions.empty()) return text.empty();
  const auto extension = std::ranges::find(kind.extensions, text);
  if (extension == kind.extensions.end()) return false;
  name.extension = *extension;
  return true;
}

/// Greater than any scale number: the stream stands before the GLBs.
constexpr std::uint32_t kStreamRank = 0xffffffffu;
constexpr std::uint32_t kMostScaleInPath = 9999;

bool is_mesh(const EntryName& name) {
  return name.kind == EntryKind::kMesh || name.kind == EntryKind::kSplitStream;
}
/// Falls from coarse to fine.
std::uint32_t mesh_rank(const EntryName& name) {
  return name.kind == EntryKind::kSplitStream ? kStreamRank : name.number;
}

/// What the order of a set of entries goes by.
struct OrderFacts {
  std::uint32_t coarsest_scale = 0, smallest_proxy = 0;
  bool has_proxies = false;
};

Place place_of(const EntryName& name, const OrderFacts& facts) {
  if (name.kind == EntryKind::kMesh && name.number == facts.coarsest_scale)
    return facts.has_proxies ? kCoarsestMesh : kFirstPicture;
  if (name.kind == EntryKind::kProxy && name.number == facts.smallest_proxy) return kFirstPicture;
  return name.kind == EntryKind::kOther ? kOthers : row_of(name.kind).place;
}

}  // namespace

std::string mesh_path(int scale) { return spell(EntryKind::kMesh, static_cast<std::uint32_t>(scale)); }
std::string proxy_path(std::uint32_t proxy) { return spell(EntryKind::kProxy, proxy); }
std::string preview_path(std::uint32_t plane) { return spell(EntryKind::kPreview, plane); }
std::string table_streams_path(std::uint32_t plane) { return spell(EntryKind::kTableStreams, plane); }
std::string rung_path(std::uint32_t plane, std::uint32_t rung) {
  return spell(EntryKind::kRung, plane, rung);
}
std::string source_path(std::uint32_t plane, std::string_view extension) {
  return spell(EntryKind::kSource, plane).append(extension);
}
std::string fragment_file_path(std::uint32_t plane, std::uint32_t rung, std::uint32_t fragment,
                               std::string_view extension) {
  return spell(EntryKind::kFragmentFile, plane, rung, fragment).append(extension);
}

std::string gltf_scale_path(int scale) {
  return spell(EntryKind::kGltfScale, static_cast<std::uint32_t>(scale));
}
std::string gltf_image_path(std::uint32_t plane, std::uint32_t rung) {
  return spell(EntryKind::kGltfImage, plane, rung);
}

EntryName parse_entry_path(const std::string& path) {
  for (const KindOfEntry& kind : kKindsOfEntries) {
    EntryName name{kind.kind};
    if (!is_of_kind(path, kind, name)) continue;
    std::string canonical = spell(kind.kind, name.number, name.rung, name.fragment);
    if (!kind.extensions.empty()) canonical += name.extension;
    const bool mesh = kind.kind == EntryKind::kMesh || kind.kind == EntryKind::kGltfScale;
    const bool fits = !mesh || name.number <= kMostScaleInPath;
    return canonical == path && fits ? name : EntryName{};
  }
  return {};
}

std::vector<std::string> streaming_order(std::vector<std::string> paths) {
  OrderFacts facts;
  std::uint32_t rungs = 0;
  std::vector<std::uint32_t> meshes;  // the stream, then scales from coarse to fine
  for (const std::string& path : paths) {
    const EntryName name = parse_entry_path(path);
    if (is_mesh(name)) meshes.push_back(mesh_rank(name));
    if (name.kind == EntryKind::kRung) rungs = std::max(rungs, name.rung + 1);
    if (name.kind == EntryKind::kProxy) {
      facts.smallest_proxy = facts.has_proxies ? std::min(facts.smallest_proxy, name.number) : name.number;
      facts.has_proxies = true;
    }
  }
  std::ranges::sort(meshes, std::greater<>());
  const auto first = std::ranges::find_if(meshes, [](std::uint32_t rank) { return rank != kStreamRank; });
  if (first != meshes.end()) {
    facts.coarsest_scale = *first;
    meshes.erase(first);
  }
  // Mesh k of M (coarse to fine, without the coarsest) follows the first rung r of R with (r + 1) M >= (k +
  // 1) R: both ladders rise together and end together.
  const auto step_of = [&](const EntryName& name) -> std::uint64_t {
    if (name.kind == EntryKind::kRung) return 2ull * name.rung;
    const auto k = static_cast<std::uint64_t>(std::ranges::find(meshes, mesh_rank(name)) - meshes.begin());
    const std::uint64_t after = ((k + 1) * rungs + meshes.size() - 1) / meshes.size();
    return 2 * after - (after > 0 ? 1 : 0);
  };
  using Key = std::tuple<int, std::uint64_t, std::uint64_t, std::string>;
  std::vector<Key> keys;
  for (std::string& path : paths) {
    const EntryName name = parse_entry_path(path);
    const Place place = place_of(name, facts);
    const std::uint64_t step = place == kInterleaved ? step_of(name) : 0;
    // Scales count down from coarse to fine; planes count up.
    const std::uint64_t rank = is_mesh(name)                             ? 0xffffffffu - mesh_rank(name)
                               : place == kOthers || place == kGltfFiles ? 0
                                                                         : name.number;
    keys.emplace_back(place, step, rank, std::move(path));
  }
  std::ranges::sort(keys);
  for (std::size_t i = 0; i < keys.size(); ++i) paths[i] = std::move(std::get<3>(keys[i]));
  return paths;
}

}  // namespace texmesh
