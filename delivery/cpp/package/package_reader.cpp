#include "delivery/cpp/package/package_reader.h"

#include <numeric>

#include "delivery/cpp/package/package_rules.h"

namespace texmesh {
namespace {

std::string plane_place(std::size_t plane) { return "texture plane " + std::to_string(plane); }

// Far above what packages have: 10,000 planes with all their rungs, 65,535 fragments each in several.
constexpr std::uint64_t kMostIndexBytes = 64ull << 20, kMostTablesBytes = 512ull << 20;
constexpr std::uint64_t kMostDocumentBytes = 64ull << 20, kMostImageBytes = 1ull << 30;

void require_size(const char* rule, const char* what, std::uint64_t expected, std::uint64_t found) {
  if (expected != found)
    throw RuleError(rule, what, "", std::to_string(expected) + " bytes, as the tables say",
                    std::to_string(found));
}

}  // namespace

std::uint64_t most_entry_bytes(const std::string& path) {
  if (path == kManifestPath) return kBootstrapBytes;
  if (path == kIndexPath) return kMostIndexBytes;
  if (path == kTablesPath) return kMostTablesBytes;
  if (path.ends_with(".json") || path.ends_with("/tables.pack")) return kMostDocumentBytes;
  if (path.starts_with("preview/")) return kMostDocumentBytes;
  return path.starts_with("source/") ? kMostImageBytes : ~0ull;
}

PackageReader::PackageReader(std::unique_ptr<PackageStore> store) : store_(std::move(store)) {
  const Bytes bytes = store_->read_manifest();
  manifest_ = read_manifest(bytes);
  id_ = sha256(bytes);
}

void PackageReader::refuse(const char* rule, const std::string& place, const std::string& expected,
                           const std::string& found) const {
  throw RuleError(rule, store_->name(), place, expected, found);
}

void PackageReader::require(const std::function<void(Findings&)>& check) const {
  Findings findings;
  check(findings);
  if (findings.empty()) return;
  const Finding& first = findings.list().front();
  refuse(first.rule.c_str(), first.entry + (first.field.empty() ? "" : ", " + first.field), first.expected,
         first.found);
}

Bytes PackageReader::entry(const EntryRef& ref) {
  if (ref.bytes > most_entry_bytes(ref.path))
    refuse("L09", "entry " + ref.path, "at most " + std::to_string(most_entry_bytes(ref.path)) + " bytes",
           std::to_string(ref.bytes));
  Bytes bytes = store_->read(ref, 0, ref.bytes);
  const Sha256 digest = sha256(bytes);
  if (digest != ref.digest)
    refuse("I08", "entry " + ref.path, "SHA-256 " + to_hex(ref.digest), to_hex(digest));
  return bytes;
}

Bytes PackageReader::read_paged(const PagedRef& ref) {
  Bytes bytes = entry(ref);
  const Sha256 digest = sha256(std::span(bytes).first(static_cast<std::size_t>(ref.head_bytes)));
  if (digest != ref.head_digest)
    refuse("R02", "head of " + ref.path, "SHA-256 " + to_hex(ref.head_digest), to_hex(digest));
  return bytes;
}

void PackageReader::require_minor(const std::string& path, int minor) const {
  if (minor != manifest_.minor)
    refuse("R01", path, "the manifest's minor version, " + std::to_string(manifest_.minor),
           std::to_string(minor));
}

void PackageReader::require_head(const PagedRef& ref, std::uint64_t head_bytes) const {
  if (ref.head_bytes != head_bytes)
    refuse("R02", "head of " + ref.path, std::to_string(ref.head_bytes) + " bytes",
           std::to_string(head_bytes));
}

const std::vector<EntryRef>& PackageReader::index() {
  if (index_) return *index_;
  const Bytes bytes = read_paged(manifest_.index);
  const IndexHead head = read_index_head(bytes);
  require_minor(kIndexPath, head.minor);
  require_head(manifest_.index, head.bytes);
  std::vector<EntryRef> entries = read_index(bytes);
  require([&](Findings& findings) { check_references(manifest_, entries, findings); });
  index_ = std::move(entries);
  return *index_;
}

std::vector<EntryRef> PackageReader::entries() {
  std::vector<EntryRef> all = index();
  if (!manifest_.gltf) return all;
  const std::vector<EntryRef> gltf = read_gltf_index(entry(*manifest_.gltf));
  all.push_back(*manifest_.gltf);
  all.insert(all.end(), gltf.begin(), gltf.end());
  std::ranges::sort(all, {}, &EntryRef::offset);
  return all;
}

const EntryRef& PackageReader::find(const std::string& path) {
  const auto it = std::ranges::find(index(), path, &EntryRef::path);
  if (it == index_->end()) refuse("R07", "entry " + path, "an entry of the index", "none");
  return *it;
}

const std::vector<TextureInfo>& PackageReader::textures() {
  if (textures_) return *textures_;
  std::vector<TextureInfo> textures = read_textures(entry(manifest_.textures));
  require([&](Findings& findings) { check_textures(manifest_, textures, findings); });
  resolve_textures(textures, index());
  textures_ = std::move(textures);
  return *textures_;
}

const PackageTables& PackageReader::tables() {
  if (tables_) return *tables_;
  std::vector<EntryRef> needed{manifest_.tables};
  if (!index_) needed.push_back(manifest_.index);
  if (!textures_) needed.push_back(manifest_.textures);
  store_->prefetch(needed);
  const Bytes bytes = read_paged(manifest_.tables);
  const TablesHead head = read_tables_head(bytes);
  require_minor(kTablesPath, head.minor);
  require_head(manifest_.tables, head.bytes);
  PackageTables tables = read_tables(bytes);
  require([&](Findings& findings) { check_tables(manifest_, textures(), tables, findings); });
  fragment_offsets_.clear();
  for (std::size_t p = 0; p < tables.planes.size(); ++p) {
    const PlaneTables& t = tables.planes[p];
    auto& offsets =
        fragment_offsets_.emplace_back(t.rung_count(), std::vector<std::uint64_t>(t.fragment_count(), 0));
    for (std::size_t r = 0; r < t.rung_count(); ++r) {
      std::uint64_t at = 0;
      for (const std::uint16_t f : t.order) {
        offsets[r][f] = at;
        at += t.size_bytes[r * t.fragment_count() + f];
      }
    }
  }
  tables_ = std::move(tables);
  return *tables_;
}

const PlaneThesis* PackageReader::plane_thesis(std::size_t plane) {
  const ThesisTables* tables = thesis();
  return tables && plane < tables->planes.size() ? &tables->planes[plane] : nullptr;
}

const PerceptualTable* PackageReader::perceptual_table() {
  const ThesisTables* tables = thesis();
  return tables && !tables->perceptual.empty() ? &tables->perceptual : nullptr;
}

const ThesisTables* PackageReader::thesis() {
  if (!thesis_ && manifest_.thesis) thesis_ = read_thesis_entry();
  return thesis_ ? &*thesis_ : nullptr;
}

ThesisTables PackageReader::read_thesis_entry() {
  ThesisFile file = read_thesis(entry(*manifest_.thesis));
  require_minor(kThesisPath, file.minor);
  const auto require = [&](bool good, std::size_t plane, const char* expected) {
    if (!good) refuse("R16", kThesisPath + std::string(", ") + plane_place(plane), expected, "others");
  };
  const auto last_scale = static_cast<std::size_t>(manifest_.scales.back().scale);
  for (std::size_t p = 0; p < file.tables.planes.size(); ++p) {
    const PlaneThesis& t = file.tables.planes[p];
    require(p < textures().size(), p, "planes of the package");
    require(t.z.empty() || t.z.size() == std::size_t{textures()[p].columns} * textures()[p].rows, p,
            "predictors of the plane's fragments");
    require(t.models.empty() || t.models.size() == std::size_t{textures()[p].columns} * textures()[p].rows, p,
            "size models of the plane's fragments");
    require(t.quality.empty() || t.quality.size() > last_scale, p, "sizes of all scales");
  }
  if (const PerceptualTable& perceptual = file.tables.perceptual; !perceptual.empty())
    for (const ManifestScale& s : manifest_.scales)
      if (!std::ranges::binary_search(perceptual.scale, s.scale))
        refuse("R16", kThesisPath + std::string(", perceptual table"), "scale " + std::to_string(s.scale),
               "none");
  return std::move(file.tables);
}

const QualityTable& PackageReader::quality() {
  if (quality_) return *quality_;
  QualityTable table = read_quality(entry(manifest_.quality));
  require([&](Findings& findings) { check_scales_and_groups(manifest_, textures(), table, findings); });
  quality_ = std::move(table);
  return *quality_;
}

const About& PackageReader::about() {
  if (!about_) about_ = read_about(entry(manifest_.about));
  return *about_;
}

const Annotations& PackageReader::annotations() {
  if (!annotations_)
    annotations_ = manifest_.annotations ? read_annotations(entry(*manifest_.annotations)) : Annotations{};
  return *annotations_;
}

Bytes PackageReader::scale_glb(int scale) {
  const ManifestScale& s = manifest_.scales[scale_index(scale)];
  if (!s.has_glb())
    throw InputError(store_->name(), mesh_path(scale), "a scale with a file of its own",
                     "one that the stream alone has");
  return entry(s.glb);
}

Bytes PackageReader::proxy_glb(std::size_t proxy) {
  if (proxy >= manifest_.proxies.size())
    throw InputError(store_->name(), "proxy " + std::to_string(proxy),
                     manifest_.proxies.empty()
                         ? "a package with proxies"
                         : "0 to " + std::to_string(manifest_.proxies.size() - 1) + ", smallest first",
                     "none");
  return entry(manifest_.proxies[proxy].glb);
}

Bytes PackageReader::split_prefix(int scale) {
  const ManifestScale& s = manifest_.scales[scale_index(scale)];
  if (s.has_glb() || !manifest_.stream)
    throw InputError(store_->name(), kSplitStreamPath, "a scale without a file",
                     "scale " + std::to_string(scale));
  Bytes bytes =
      store_->read({kSplitStreamPath, manifest_.stream->offset, manifest_.stream->bytes, {}}, 0, s.glb.bytes);
  const Sha256 digest = sha256(bytes);
  if (digest != s.glb.digest)
    refuse("M17", std::string("prefix of ") + kSplitStreamPath, "SHA-256 " + to_hex(s.glb.digest),
           to_hex(digest));
  return bytes;
}

std::size_t PackageReader::scale_index(int scale) const {
  std::string known;
  for (std::size_t k = 0; k < manifest_.scales.size(); ++k) {
    if (manifest_.scales[k].scale == scale) return k;
    known += (k == 0 ? "" : ", ") + std::to_string(manifest_.scales[k].scale);
  }
  throw InputError(store_->name(), "", "one of its scales " + known, "scale " + std::to_string(scale));
}

SplitStreamHead PackageReader::split_stream_head() {
  if (!manifest_.stream)
    throw FormatError(store_->name(), kSplitStreamPath, "a stream of vertex splits", "none");
  const StreamRef& ref = *manifest_.stream;
  const Bytes head = store_->read({kSplitStreamPath, ref.offset, ref.bytes, {}}, 0, ref.head_bytes);
  if (sha256(head) != ref.head_digest)
    refuse("R02", std::string("head of ") + kSplitStreamPath, to_hex(ref.head_digest), to_hex(sha256(head)));
  SplitStreamHead parsed = read_split_head(head);
  if (parsed.bytes != ref.head_bytes)
    refuse("S08", std::string("head of ") + kSplitStreamPath, std::to_string(ref.head_bytes) + " bytes",
           std::to_string(parsed.bytes));
  const SplitBlock& last = parsed.blocks.back();
  if (last.offset + last.bytes() != ref.bytes)
    refuse("S08", kSplitStreamPath, "blocks that end with the entry",
           "an end at byte " + std::to_string(last.offset + last.bytes()));
  return parsed;
}

const TextureInfo& PackageReader::texture(std::uint32_t plane) {
  if (plane >= textures().size())
    throw FormatError(store_->name(), plane_place(plane), "one of " + std::to_string(textures_->size()),
                      "none");
  return (*textures_)[plane];
}

Bytes PackageReader::preview(std::uint32_t plane) { return entry(texture(plane).preview); }

Bytes PackageReader::source(std::uint32_t plane) {
  const TextureInfo& info = texture(plane);
  if (info.source_extension.empty())
    throw FormatError(store_->name(), plane_place(plane), "a source image in the package", "none");
  return entry(info.source);
}

Bytes PackageReader::table_stream(std::uint32_t plane, std::uint32_t rung) {
  const TextureInfo& info = texture(plane);
  const PlaneTables& t = tables().planes[plane];
  if (rung >= t.rung_count())
    throw FormatError(store_->name(), plane_place(plane), "a rung under " + std::to_string(t.rung_count()),
                      std::to_string(rung));
  auto it = table_streams_.find(plane);
  if (it == table_streams_.end()) it = table_streams_.emplace(plane, entry(info.tables)).first;
  const auto begin = std::accumulate(t.table_bytes.begin(), t.table_bytes.begin() + rung, std::uint64_t{0});
  const auto stream = std::span(it->second).subspan(static_cast<std::size_t>(begin), t.table_bytes[rung]);
  return {stream.begin(), stream.end()};
}

ByteRange PackageReader::fragment_range(std::uint32_t plane, std::uint32_t rung, std::uint32_t fragment) {
  texture(plane);
  const PlaneTables& t = tables().planes[plane];
  if (rung >= t.rung_count() || fragment >= t.fragment_count())
    throw FormatError(store_->name(), plane_place(plane),
                      "a rung under " + std::to_string(t.rung_count()) + " and a fragment under " +
                          std::to_string(t.fragment_count()),
                      std::to_string(rung) + ", " + std::to_string(fragment));
  return {fragment_offsets_[plane][rung][fragment], t.size_bytes[rung * t.fragment_count() + fragment]};
}

Bytes PackageReader::fragment(std::uint32_t plane, std::uint32_t rung, std::uint32_t fragment) {
  const ByteRange range = fragment_range(plane, rung, fragment);
  const EntryRef& pack = textures()[plane].rungs[rung];
  const std::string place = "fragment " + std::to_string(fragment) + " of " + pack.path;
  if (range.bytes == 0) refuse("T07", place, "a stored fragment", "none");
  Bytes bytes = store_->read(pack, range.offset, range.bytes);
  const PlaneTables& t = tables().planes[plane];
  if (truncated(sha256(bytes)) != t.digest[rung * t.fragment_count() + fragment])
    refuse("F03", place, "bytes of the digest in tables.bin", "others");
  return bytes;
}

Bytes PackageReader::complete_fragment(std::uint32_t plane, std::uint32_t rung, std::uint32_t fragment) {
  const Codec codec = texture(plane).codec;
  const std::uint32_t first = codec_traits(codec).incremental ? 0 : rung;
  std::vector<Bytes> streams;
  for (std::uint32_t r = first; r <= rung; ++r) streams.push_back(this->fragment(plane, r, fragment));
  return join_fragment(codec, table_stream(plane, first),
                       std::vector<ByteSpan>(streams.begin(), streams.end()));
}

int select_scale(const Manifest& manifest, double displayed_px) {
  for (const ManifestStep& step : manifest.steps)
    if (displayed_px <= step.up_to_px) return step.scale;
  return 0;
}

PlaneStreams::PlaneStreams(Codec codec, const PlaneTables& tables, Bytes table_pack)
    : codec_(codec),
      tables_(tables),
      table_pack_(std::move(table_pack)),
      packs_(tables.rung_count()),
      offsets_(tables.rung_count()) {
  require_size("R12", "table streams",
               std::accumulate(tables.table_bytes.begin(), tables.table_bytes.end(), std::uint64_t{0}),
               table_pack_.size());
}

void PlaneStreams::add_pack(std::size_t rung, Bytes pack) {
  const std::size_t fragments = tables_.fragment_count();
  const bool incremental = codec_traits(codec_).incremental;
  if (rung >= packs_.size() || (incremental && rung > 0 && offsets_[rung - 1].empty()))
    throw FormatError("rung " + std::to_string(rung), "", "the next one", "another");
  std::vector<std::uint64_t> offsets(fragments);
  std::uint64_t at = 0;
  for (const std::uint16_t f : tables_.order) {
    offsets[f] = at;
    at += tables_.size_bytes[rung * fragments + f];
  }
  require_size("R13", "rung", at, pack.size());
  if (!incremental) packs_[rung_].clear();
  rung_ = rung;
  packs_[rung] = std::move(pack);
  offsets_[rung] = std::move(offsets);
}

ByteSpan PlaneStreams::stream(std::size_t rung, std::size_t fragment) const {
  return std::span(packs_[rung])
      .subspan(static_cast<std::size_t>(offsets_[rung].at(fragment)),
               tables_.size_bytes[rung * tables_.fragment_count() + fragment]);
}

ByteSpan PlaneStreams::stream(std::size_t fragment) const { return stream(rung_, fragment); }

Bytes PlaneStreams::file(std::size_t fragment) const {
  const std::size_t first = codec_traits(codec_).incremental ? 0 : rung_;
  std::vector<ByteSpan> streams;
  for (std::size_t r = first; r <= rung_; ++r) streams.push_back(stream(r, fragment));
  return join_fragment(codec_, table_stream(first), streams);
}

ByteSpan PlaneStreams::table_stream(std::size_t rung) const {
  std::uint64_t at = 0;
  for (std::size_t r = 0; r < rung; ++r) at += tables_.table_bytes[r];
  return std::span(table_pack_).subspan(static_cast<std::size_t>(at), tables_.table_bytes[rung]);
}

}  // namespace texmesh
