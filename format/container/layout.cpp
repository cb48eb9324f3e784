#include "format/container/layout.h"

#include <algorithm>
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

/// Takes the digits at the front of `text`; false when there are none or the number does not fit.
bool consume_number(std::string_view& text, std::uint32_t& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end == text.data()) return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return true;
}

bool consume_prefix(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

EntryName parse_texture_path(std::string_view text) {
  EntryName name;
  if (!consume_number(text, name.number) || !consume_prefix(text, "/")) return {};
  if (text == "tables.pack") {
    name.kind = EntryKind::kTableStreams;
  } else if (consume_prefix(text, "r") && consume_number(text, name.rung)) {
    if (text == ".pack") name.kind = EntryKind::kRung;
    if (consume_prefix(text, "/") && consume_number(text, name.fragment) && consume_prefix(text, "."))
      for (const std::string_view extension : {"jpg", "webp"})
        if (text == extension) name.kind = EntryKind::kFragmentFile, name.extension = extension;
  }
  return name;
}

EntryName parse_any_spelling(std::string_view path) {
  constexpr std::pair<const char*, EntryKind> kSingle[] = {
      {kManifestPath, EntryKind::kManifest},
      {kIndexPath, EntryKind::kIndex},
      {kTablesPath, EntryKind::kTables},
      {kTexturesPath, EntryKind::kTextures},
      {kQualityPath, EntryKind::kQuality},
      {kProvenancePath, EntryKind::kProvenance},
      {kSplitStreamPath, EntryKind::kSplitStream},
      {kPosterPath, EntryKind::kPoster},
      {kThesisPath, EntryKind::kThesis},
      {kAboutPath, EntryKind::kAbout},
      {kContentCredentialPath, EntryKind::kContentCredential}};
  for (const auto& [single, kind] : kSingle)
    if (path == single) return {kind};
  std::string_view text = path;
  EntryName name;
  if (consume_prefix(text, "mesh/s")) {
    if (consume_number(text, name.number) && text == ".glb") name.kind = EntryKind::kMesh;
  } else if (consume_prefix(text, "proxies/")) {
    if (consume_number(text, name.number) && text == ".glb") name.kind = EntryKind::kProxy;
  } else if (consume_prefix(text, "preview/")) {
    if (consume_number(text, name.number) && text == ".jpg") name.kind = EntryKind::kPreview;
  } else if (consume_prefix(text, "source/")) {
    if (consume_number(text, name.number) && consume_prefix(text, "."))
      for (const std::string_view extension : kSourceExtensions)
        if (text == extension) name.kind = EntryKind::kSource, name.extension = extension;
  } else if (consume_prefix(text, "texture/")) {
    return parse_texture_path(text);
  }
  return name;
}

std::string spell(const EntryName& name) {
  switch (name.kind) {
    case EntryKind::kMesh:
      return name.number > 9999 ? "" : mesh_path(static_cast<int>(name.number));
    case EntryKind::kProxy:
      return proxy_path(name.number);
    case EntryKind::kPreview:
      return preview_path(name.number);
    case EntryKind::kTableStreams:
      return table_streams_path(name.number);
    case EntryKind::kRung:
      return rung_path(name.number, name.rung);
    case EntryKind::kFragmentFile:
      return fragment_file_path(name.number, name.rung, name.fragment, name.extension);
    case EntryKind::kSource:
      return source_path(name.number, name.extension);
    default:
      return "";
  }
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
  kBehindAll
};

/// Greater than any scale number: the stream stands before the GLBs.
constexpr std::uint32_t kStreamRank = 0xffffffffu;

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
  switch (name.kind) {
    case EntryKind::kManifest:
      return kManifestPlace;
    case EntryKind::kIndex:
      return kIndexPlace;
    case EntryKind::kTables:
      return kTablesPlace;
    case EntryKind::kTextures:
      return kTexturesPlace;
    case EntryKind::kQuality:
      return kQualityPlace;
    case EntryKind::kMesh:
      if (name.number != facts.coarsest_scale) return kInterleaved;
      return facts.has_proxies ? kCoarsestMesh : kFirstPicture;
    case EntryKind::kProxy:
      return name.number == facts.smallest_proxy ? kFirstPicture : kProxies;
    case EntryKind::kPreview:
      return kPreviews;
    case EntryKind::kTableStreams:
      return kTableStreamsPlace;
    case EntryKind::kPoster:
      return kPosterPlace;
    case EntryKind::kAbout:
      return kAboutPlace;
    case EntryKind::kRung:
    case EntryKind::kSplitStream:
      return kInterleaved;
    case EntryKind::kProvenance:
      return kLast;
    case EntryKind::kContentCredential:
      return kBehindAll;
    case EntryKind::kFragmentFile:
    case EntryKind::kSource:
    case EntryKind::kThesis:
    case EntryKind::kOther:
      return kOthers;
  }
  return kOthers;
}

}  // namespace

std::string mesh_path(int scale) { return print("mesh/s%02d.glb", scale); }
std::string proxy_path(std::uint32_t proxy) { return print("proxies/%02u.glb", proxy); }
std::string preview_path(std::uint32_t plane) { return print("preview/%03u.jpg", plane); }
std::string table_streams_path(std::uint32_t plane) { return print("texture/%u/tables.pack", plane); }
std::string rung_path(std::uint32_t plane, std::uint32_t rung) {
  return print("texture/%u/r%02u.pack", plane, rung);
}
std::string source_path(std::uint32_t plane, std::string_view extension) {
  return print("source/%03u.", plane).append(extension);
}
std::string fragment_file_path(std::uint32_t plane, std::uint32_t rung, std::uint32_t fragment,
                               std::string_view extension) {
  return print("texture/%u/r%02u/%04u.", plane, rung, fragment).append(extension);
}

EntryName parse_entry_path(const std::string& path) {
  const EntryName name = parse_any_spelling(path);
  const std::string canonical = spell(name);
  if (!canonical.empty()) return canonical == path ? name : EntryName{};
  const bool numbered = name.kind >= EntryKind::kMesh && name.kind <= EntryKind::kSource;
  return numbered ? EntryName{} : name;
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
    const std::uint64_t rank = is_mesh(name)      ? 0xffffffffu - mesh_rank(name)
                               : place == kOthers ? 0
                                                  : name.number;
    keys.emplace_back(place, step, rank, std::move(path));
  }
  std::ranges::sort(keys);
  for (std::size_t i = 0; i < keys.size(); ++i) paths[i] = std::move(std::get<3>(keys[i]));
  return paths;
}

}  // namespace texmesh
