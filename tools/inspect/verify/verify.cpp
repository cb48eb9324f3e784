#include "tools/inspect/verify/verify.h"

#include <fmt/format.h>
#include <new>
#include <nlohmann/json.hpp>
#include <numeric>
#include <tuple>

#include "format/base/json_fields.h"
#include "format/rules/allocation.h"
#include "pipeline/io/table.h"
#include "stages/base/parallel.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/decode_image.h"
#include "stages/image/jpeg_segments.h"
#include "stages/jpeg/jpeg.h"
#include "tools/inspect/package_tree.h"
#include "tools/inspect/provenance.h"
#include "tools/inspect/verify/verify_checks.h"

namespace texmesh {
namespace {

std::string shape_text(std::uint32_t width_px, std::uint32_t height_px, std::uint32_t channels) {
  return fmt::format("{} x {} px, {} channels", width_px, height_px, channels);
}

std::uint64_t sum(const std::vector<std::uint32_t>& v) {
  return std::accumulate(v.begin(), v.end(), std::uint64_t{0});
}

/// Stored fragments are covered, and stand by falling importance. (Readers check that covered ones are
/// stored.)
void check_order(std::uint32_t plane, const PlaneTables& t, Findings& findings) {
  for (const std::uint16_t f : t.order)
    findings.require(t.covered_texels[f] > 0, {"tables-coverage", "T11"}, kTablesPath,
                     plane_field(plane, "fragment " + std::to_string(f)), "covered texels, as it is stored",
                     "none");
  const std::vector<float> eta = eta_of(t, 0);
  for (std::size_t k = 1; k < t.order.size(); ++k) {
    const std::size_t a = t.order[k - 1], b = t.order[k];
    const bool falling = eta[a] != eta[b] ? eta[a] > eta[b]
                         : t.surface_fraction[a] != t.surface_fraction[b]
                             ? t.surface_fraction[a] > t.surface_fraction[b]
                             : a < b;
    findings.require(
        falling, {"tables-order", "T12"}, kTablesPath, plane_field(plane, "order[" + std::to_string(k) + "]"),
        "falling importance (eta, surface, index)", std::to_string(b) + " after " + std::to_string(a));
  }
}

void check_fragment(const TextureInfo& texture, const PlaneTables& t, std::uint32_t rung, std::size_t i,
                    const PlaneStreams& streams, Findings& findings) {
  const std::string& entry = texture.rungs[rung].path;
  const std::string field = "fragment " + std::to_string(i);
  const std::uint64_t stated = t.digest[rung * t.fragment_count() + i],
                      real = truncated(sha256(streams.stream(i)));
  if (stated != real) {
    findings.add({"fragment-digest", "F03"}, entry, field, fmt::format("{:016x}", stated),
                 fmt::format("{:016x}", real));
  }
  try {
    const std::uint64_t texels =
        static_cast<std::uint64_t>(texture.fragment_width_px) * texture.fragment_height_px;
    const Pixels pixels = decode_fragment_file(texture.codec, streams.file(i), texels);
    findings.require(pixels.width_px == texture.fragment_width_px &&
                         pixels.height_px == texture.fragment_height_px &&
                         pixels.channels == texture.channels,
                     {"fragment-decode", "F08"}, entry, field,
                     shape_text(texture.fragment_width_px, texture.fragment_height_px, texture.channels),
                     shape_text(pixels.width_px, pixels.height_px, pixels.channels));
  } catch (const Error& e) {
    const std::string rule = rule_of(e);
    findings.add({"fragment-decode", rule.empty() ? "F08" : rule.c_str()}, entry, field, e.expected(),
                 e.found());
  }
}

constexpr std::uint8_t kExif = 0xe1, kProfile = 0xe2, kRestartInterval = 0xdd;

/// What stands in front of a JPEG's first scan.
struct JpegSegments {
  bool has_profile = false, has_restarts = false;
  std::vector<std::uint8_t> frame;  // per component: sampling factors
};

JpegSegments read_segments(ByteSpan jpeg) {
  JpegSegments found;
  for_each_jpeg_segment(jpeg, [&](std::uint8_t marker, ByteSpan body) {
    found.has_profile |= marker == kExif || marker == kProfile;
    found.has_restarts |= marker == kRestartInterval;
    if (is_jpeg_frame(marker))
      for (std::size_t k = 7; k < body.size(); k += 3) found.frame.push_back(body[k]);
  });
  return found;
}

void check_jpeg_head(const std::string& entry, const std::string& field, std::span<const std::uint8_t> jpeg,
                     Findings& findings) {
  findings.require(!read_segments(jpeg).has_profile, {"jpeg-head", "F10"}, entry, field,
                   "neither EXIF nor a colour profile", "one");
}

void check_source_rung(const TextureInfo& texture, std::span<const std::span<const std::uint8_t>> tables,
                       Findings& findings) {
  const std::string& entry = texture.tables.path;
  const JpegSegments last = read_segments(tables.back());
  std::uint32_t h = 1, v = 1;
  for (const std::uint8_t factors : last.frame) {
    h = std::max<std::uint32_t>(h, factors >> 4), v = std::max<std::uint32_t>(v, factors & 15);
    const auto is_factor = [](int f) { return f == 1 || f == 2 || f == 4; };
    findings.require(is_factor(factors >> 4) && is_factor(factors & 15), {"source-rung", "F13"}, entry, "",
                     "sampling factors 1, 2 and 4",
                     std::to_string(factors >> 4) + ", " + std::to_string(factors & 15));
  }
  for (std::size_t r = 0; r < tables.size(); ++r)
    findings.require(read_segments(tables[r]).frame == last.frame, {"source-rung", "F13"}, entry,
                     "rung " + std::to_string(r), "the components of the last rung", "others");
  findings.require(!last.has_restarts, {"source-rung", "F12"}, entry, "last rung", "no restart interval",
                   "one");
  findings.require(
      texture.fragment_width_px % (8 * h) == 0 && texture.fragment_height_px % (8 * v) == 0,
      {"source-rung", "F12"}, entry, "last rung", "fragments of whole MCUs",
      std::to_string(texture.fragment_width_px) + " x " + std::to_string(texture.fragment_height_px) + " px");
}

/// One plane for the colours and one for the alpha of an image at every size.
void check_planes(const std::vector<TextureInfo>& textures, Findings& findings) {
  std::set<std::tuple<std::uint32_t, bool, std::uint32_t>> seen;
  for (std::size_t k = 0; k < textures.size(); ++k)
    findings.require(seen.insert({textures[k].image, textures[k].role == "alpha", textures[k].mip}).second,
                     {"textures", "X08"}, kTexturesPath, "/" + std::to_string(k),
                     "one plane for the colours and one for the alpha of image " +
                         std::to_string(textures[k].image) + " at every size",
                     "another");
}

/// One plane's tables in themselves: order, surface, covered texels.
void check_plane_tables(const TextureInfo& texture, std::uint32_t plane, const PlaneTables& t,
                        Findings& findings) {
  check_order(plane, t, findings);
  double surface = 0;
  const std::uint64_t texels =
      static_cast<std::uint64_t>(texture.fragment_width_px) * texture.fragment_height_px;
  for (std::size_t i = 0; i < t.fragment_count(); ++i) {
    surface += static_cast<double>(t.surface_fraction[i]);
    findings.require(t.covered_texels[i] <= texels, {"tables", "T11"}, kTablesPath,
                     plane_field(plane, "covered texels of fragment " + std::to_string(i)),
                     "at most " + std::to_string(texels), t.covered_texels[i]);
  }
  findings.require(surface <= 1.001, {"tables", "T11"}, kTablesPath, plane_field(plane, "surface"),
                   "at most the whole surface, 1", shortest(surface, 6));
}

void check_preview(const TextureInfo& texture, std::span<const std::uint8_t> jpeg, Findings& findings) {
  try {
    check_jpeg_head(texture.preview.path, "", jpeg, findings);
    const Pixels p = decode_jpeg(jpeg, 1ull << 26);
    findings.require(p.width_px == texture.preview_width_px && p.height_px == texture.preview_height_px &&
                         p.channels == texture.channels,
                     {"preview", "F16"}, texture.preview.path, "",
                     shape_text(texture.preview_width_px, texture.preview_height_px, texture.channels),
                     shape_text(p.width_px, p.height_px, p.channels));
  } catch (const Error& e) {
    findings.add({"preview", "F16"}, texture.preview.path, e.place(), e.expected(), e.found());
  }
}

/// The source image that a plane keeps: of that format and the plane's size, and it decodes.
void check_source(const TextureInfo& texture, std::vector<std::uint8_t> bytes, Findings& findings) {
  try {
    const Image image = probe_image(texture.source.path, std::move(bytes), {});
    findings.require(image_extension(image.format) == texture.source_extension &&
                         image.width_px == texture.width_px && image.height_px == texture.height_px &&
                         image.channels >= texture.channels,
                     {"source", "O02"}, texture.source.path, "",
                     texture.source_extension + " of " + std::to_string(texture.width_px) + " x " +
                         std::to_string(texture.height_px) + " px",
                     std::string(image_extension(image.format)) + " of " + std::to_string(image.width_px) +
                         " x " + std::to_string(image.height_px) + " px");
    decode_image(image);
  } catch (const Error& e) {
    findings.add({"source", "O02"}, texture.source.path, e.place(), e.expected(), e.found());
  }
}

/// The table streams of all rungs: each as the codec has it, of the size the tables say.
void check_table_streams(const TextureInfo& texture, const PlaneTables& t, std::span<const std::uint8_t> pack,
                         Findings& findings) {
  if (pack.size() != sum(t.table_bytes)) return;  // check_textures says so
  std::size_t offset = 0;
  std::vector<std::span<const std::uint8_t>> streams;
  for (std::size_t r = 0; r < t.rung_count(); ++r) {
    streams.push_back(pack.subspan(offset, t.table_bytes[r]));
    check_jpeg_head(texture.tables.path, "rung " + std::to_string(r), streams.back(), findings);
    findings.require(
        is_table_stream(texture.codec, static_cast<std::uint32_t>(r), pack.subspan(offset, t.table_bytes[r])),
        {"table-stream", is_baseline(texture.codec) ? "F05" : "F06"}, texture.tables.path,
        "rung " + std::to_string(r),
        "a table stream of " + std::string(codec_traits(texture.codec).id) + " in " +
            std::to_string(t.table_bytes[r]) + " bytes",
        "other bytes");
    offset += t.table_bytes[r];
  }
  if (texture.source_rung) check_source_rung(texture, streams, findings);
}

/// All fragments of the rung that was added to `streams` last: digest, and the decoded image's size and
/// channels. Returns the number of fragments looked at.
std::uint64_t check_rung(const TextureInfo& texture, const PlaneTables& t, std::uint32_t rung,
                         const PlaneStreams& streams, const RunContext& context, Findings& findings) {
  std::vector<Findings> per_fragment(t.order.size());
  parallel_each(context, t.order.size(), 1, [&](std::size_t k) {
    check_fragment(texture, t, rung, t.order[k], streams, per_fragment[k]);
  });
  for (Findings& f : per_fragment) findings.append(std::move(f));
  return t.order.size();
}

constexpr std::uint64_t kMostProvenanceBytes = 64u << 20;

/// Runs `body`; what it throws about the package becomes a finding, and the result is false.
template <class Body>
bool guarded(Findings& findings, const Check& check, const std::string& entry, Body&& body) {
  try {
    body();
    return true;
  } catch (const FormatError& e) {
    findings.add(check, entry, e);
  } catch (const std::bad_alloc&) {
    findings.add(check, entry, "", "data that fits the memory limit", "more");
  }
  return false;
}

/// Reads the entries of a package, each compared with its digest and with what the container says of it.
class CheckedStore {
 public:
  /// Adds to `findings`, and to the entries and bytes of `report`.
  CheckedStore(PackageStore& store, Findings& findings, VerifyReport& report)
      : store_(store), findings_(findings), report_(report) {}

  void list_entries() {
    guarded(findings_, "container", "", [&] { listed_ = store_.list(); });
    for (const ContainerEntry& e : listed_) by_path_[e.path] = &e;
    if (store_.is_folder() || listed_.empty()) return;
    findings_.require_equal(kManifestPath, listed_.front().path, {"bootstrap", "K11"}, "", "first entry");
    const std::uint64_t end = listed_.front().offset + listed_.front().bytes;
    findings_.require(end <= kBootstrapBytes, {"bootstrap", "K12"}, kManifestPath, "end",
                      "at most byte " + std::to_string(kBootstrapBytes), "byte " + std::to_string(end));
  }
  Bytes read_manifest() {
    Bytes bytes = store_.read_manifest();
    check_stored(kManifestPath, bytes, 0);
    return bytes;
  }
  /// FormatError when the bytes are not there.
  Bytes read(const EntryRef& ref) {
    Bytes bytes = store_.read(ref, 0, ref.bytes);
    findings_.require_equal(to_hex(ref.digest), to_hex(sha256(bytes)), {"entry-digest", "I08"}, ref.path,
                            "sha256");
    check_stored(ref.path, bytes, ref.offset);
    return bytes;
  }
  /// The index names exactly what is there, in the order that the format prescribes.
  void check_entry_set(std::vector<EntryRef> index, const EntryRef& index_entry) {
    if (listed_.empty()) return;  // "container" says why
    index.insert(std::ranges::upper_bound(index, index_entry.offset, {}, &EntryRef::offset), index_entry);
    std::vector<std::string> named{kManifestPath};
    for (const EntryRef& e : index) named.push_back(e.path);
    for (const std::string& path : named)
      findings_.require(contains(path), {"entry-set", "I08"}, path, "",
                        "an entry of the package, as the index says", "none");
    std::vector<std::string> sorted = named;
    std::sort(sorted.begin(), sorted.end());
    for (const ContainerEntry& e : listed_) {
      const bool extra = store_.is_folder() && (parse_entry_path(e.path).kind == EntryKind::kFragmentFile ||
                                                e.path == kFragmentIndexPath);
      if (e.path == kContentCredentialPath)
        check_content_credential(e);
      else if (!extra && !std::binary_search(sorted.begin(), sorted.end(), e.path))
        findings_.add({"entry-set", "I08"}, e.path, "", "to be named by the index", "not there");
    }
    const std::vector<std::string> order = streaming_order(named);
    for (std::size_t k = 0; k < std::min(order.size(), named.size()); ++k)
      if (!findings_.require_equal(order[k], named[k], {"entry-order", "E04"}, kIndexPath,
                                   "entry " + std::to_string(k)))
        break;
  }

  PackageStore& store() { return store_; }
  const std::vector<ContainerEntry>& listed() const { return listed_; }
  bool contains(const std::string& path) const { return by_path_.contains(path); }

 private:
  /// It is the last entry: list() has seen to that.
  void check_content_credential(const ContainerEntry& entry) {
    report_.content_credential = true;
    findings_.require(entry.bytes > 0 && entry.bytes <= kMaxContentCredentialBytes,
                      {"content-credential", "O07"}, entry.path, "",
                      "1 to " + std::to_string(kMaxContentCredentialBytes) + " bytes", entry.bytes);
  }
  void check_stored(const std::string& path, const Bytes& bytes, std::uint64_t offset) {
    ++report_.entries;
    report_.bytes += bytes.size();
    const auto it = by_path_.find(path);
    if (it == by_path_.end()) return;  // check_entry_set says so
    if (!store_.is_folder())
      findings_.require_equal(fmt::format("{:08x}", crc_of(bytes)), fmt::format("{:08x}", it->second->crc32),
                              {"entry-crc", "K07"}, path, "CRC-32");
    if (!store_.is_folder() && path != kManifestPath)
      findings_.require_equal(it->second->offset, offset, {"entry-set", "I08"}, path, "offset");
    findings_.require_equal(it->second->bytes, bytes.size(), {"entry-set", "I08"}, path, "bytes");
  }

  PackageStore& store_;
  Findings& findings_;
  VerifyReport& report_;
  std::vector<ContainerEntry> listed_;
  std::map<std::string, const ContainerEntry*> by_path_;
};

/// The documents of a package, as far as they could be read.
struct VerifiedDocuments {
  Manifest manifest;
  std::vector<EntryRef> index;
  std::optional<std::vector<TextureInfo>> textures;
  std::optional<PackageTables> tables;
  std::vector<bool> consistent;  // per plane: textures.json and tables.bin describe the same grid and rungs
};

/// Looks at the entries that are no documents, against the documents.
class EntryVerifier {
 public:
  EntryVerifier(CheckedStore& store, const VerifiedDocuments& package, const RunContext& context,
                Findings& findings, VerifyReport& report)
      : store_(store), package_(package), context_(context), findings_(findings), report_(report) {}

  /// In container order.
  void check_entry(const EntryRef& e) {
    const EntryName name = parse_entry_path(e.path);
    const bool texture = name.kind == EntryKind::kPreview || name.kind == EntryKind::kTableStreams ||
                         name.kind == EntryKind::kRung;
    if (name.kind == EntryKind::kMesh) {
      guarded(findings_, "entry-read", e.path, [&] { check_mesh_entry(e, static_cast<int>(name.number)); });
    } else if (name.kind == EntryKind::kProxy) {
      guarded(findings_, "entry-read", e.path, [&] { check_proxy_entry(e, name.number); });
    } else if (texture) {
      guarded(findings_, "entry-read", e.path, [&] { check_texture_entry(e, name); });
    } else if (name.kind == EntryKind::kSplitStream) {
      guarded(findings_, {"split-stream", "S08"}, e.path,
              [&] { check_split_stream(package_.manifest, store_.read(e), share_, context_, findings_); });
    } else if (name.kind == EntryKind::kPoster) {
      guarded(findings_, {"poster", "O01"}, e.path, [&] { check_poster_entry(e); });
    } else if (name.kind == EntryKind::kThesis || name.kind == EntryKind::kAnnotations) {
      const Manifest& m = package_.manifest;
      findings_.require((name.kind == EntryKind::kThesis ? m.thesis : m.annotations).has_value(),
                        {"entry-set", "E03"}, e.path, "", "to be named by the manifest", "not there");
    } else if (name.kind != EntryKind::kOther && is_gltf_file(e.path)) {
      guarded(findings_, {"gltf", "H04"}, e.path, [&] { check_gltf_entry(e, name.kind); });
    } else if (name.kind == EntryKind::kSource) {
      guarded(findings_, {"source", "O02"}, e.path, [&] { check_source_entry(e, name); });
    } else if (name.kind == EntryKind::kOther || name.kind == EntryKind::kFragmentFile) {
      findings_.require(package_.manifest.minor > kFormatMinor, {"entry-unknown", "E03"}, e.path, "",
                        "an entry that format " + std::to_string(kFormatMajor) + "." +
                            std::to_string(kFormatMinor) + " defines",
                        "another");
      guarded(findings_, "entry-read", e.path, [&] { store_.read(e); });
    }
  }
  /// Fragment files of `unpack --fragments files`: each is its fragment with the rung's tables in front.
  void check_extra_files() {
    if (!package_.textures || !package_.tables || !store_.contains(kFragmentIndexPath)) {
      for (const ContainerEntry& e : store_.listed())
        if (parse_entry_path(e.path).kind == EntryKind::kFragmentFile)
          findings_.add("fragment-file", e.path, "",
                        std::string("a ") + kFragmentIndexPath + " beside fragment files", "none");
      return;
    }
    if (std::find(package_.consistent.begin(), package_.consistent.end(), false) != package_.consistent.end())
      return;
    guarded(findings_, "fragment-file", kFragmentIndexPath, [&] {
      check_fragment_files(store_.store(), store_.listed(), *package_.textures, *package_.tables, findings_);
    });
  }

 private:
  void check_mesh_entry(const EntryRef& e, int number) {
    const Bytes bytes = store_.read(e);
    const auto scale = std::find_if(package_.manifest.scales.begin(), package_.manifest.scales.end(),
                                    [&](const ManifestScale& s) { return s.scale == number; });
    if (!findings_.require(scale != package_.manifest.scales.end() && scale->has_glb(), {"entry-set", "E03"},
                           e.path, "", "a file of a scale of the manifest", "none"))
      return;
    ++report_.meshes;
    std::vector<Vec3d> positions = check_mesh(package_.manifest, *scale, package_.textures, bytes, findings_);
    if (!positions.empty()) check_shared(e.path, bytes, share_, findings_);
    // Meshes stand from coarse to fine; any other order is a finding of "entry-order".
    if (coarser_ && coarser_->scale > scale->scale)
      check_nested(*scale, positions, *coarser_, coarser_positions_, findings_);
    coarser_ = &*scale;
    coarser_positions_ = std::move(positions);
  }
  void check_gltf_entry(const EntryRef& e, EntryKind kind) {
    if (kind == EntryKind::kGltfIndex) return;  // read already
    const Bytes bytes = store_.read(e);
    if (!package_.textures) return;
    if (kind == EntryKind::kGltfImage) return check_gltf_image(*package_.textures, e.path, bytes, findings_);
    ++report_.meshes;
    if (check_gltf_scale(package_.manifest, package_.index, *package_.textures, e, bytes, findings_))
      check_shared(e.path, bytes, share_, findings_);
  }
  void check_proxy_entry(const EntryRef& e, std::size_t number) {
    const Bytes bytes = store_.read(e);
    const std::vector<ManifestProxy>& proxies = package_.manifest.proxies;
    if (!findings_.require(number < proxies.size(), "entry-set", e.path, "", "to be named by the manifest",
                           "not there"))
      return;
    ++report_.meshes;
    check_proxy(package_.manifest, proxies[number], bytes, findings_);
  }
  void check_texture_entry(const EntryRef& e, const EntryName& name) {
    const Bytes bytes = store_.read(e);
    if (!package_.textures || !package_.tables) return;  // they have their findings
    const std::size_t plane = name.number;
    if (!findings_.require(plane < package_.textures->size(), {"entry-set", "E03"}, e.path, "",
                           "a plane of textures.json", "none"))
      return;
    const TextureInfo& info = (*package_.textures)[plane];
    if (name.kind == EntryKind::kPreview) {
      ++report_.previews;
      check_preview(info, bytes, findings_);
    }
    if (plane >= package_.consistent.size() || !package_.consistent[plane]) return;
    const PlaneTables& t = package_.tables->planes[plane];
    if (name.kind == EntryKind::kTableStreams) {
      check_table_streams(info, t, bytes, findings_);
    } else if (name.kind == EntryKind::kRung) {
      if (!findings_.require(name.rung < t.rung_count(), {"entry-set", "E03"}, e.path, "",
                             "a rung of textures.json", "none"))
        return;
      check_rung_entry(info, t, name, bytes);
    }
  }
  void check_source_entry(const EntryRef& e, const EntryName& name) {
    Bytes bytes = store_.read(e);
    if (!package_.textures) return;
    const bool named = name.number < package_.textures->size() &&
                       (*package_.textures)[name.number].source_extension == name.extension;
    if (findings_.require(named, {"entry-set", "E03"}, e.path, "", "to be named by textures.json",
                          "not there"))
      check_source((*package_.textures)[name.number], std::move(bytes), findings_);
  }
  void check_poster_entry(const EntryRef& e) {
    const Bytes bytes = store_.read(e);
    const std::optional<PosterRef>& poster = package_.manifest.poster;
    if (!findings_.require(poster.has_value(), {"entry-set", "E03"}, e.path, "",
                           "to be named by the manifest", "not there"))
      return;
    const Pixels pixels = decode_jpeg(bytes, std::uint64_t{kMaxPosterSide} * kMaxPosterSide);
    findings_.require_equal(poster->width_px, pixels.width_px, {"poster", "O01"}, e.path, "width");
    findings_.require_equal(poster->height_px, pixels.height_px, {"poster", "O01"}, e.path, "height");
  }
  void check_rung_entry(const TextureInfo& info, const PlaneTables& t, const EntryName& name, Bytes bytes) {
    std::uint64_t table_bytes = 0, rung_bytes = 0;
    for (const std::uint32_t n : t.table_bytes) table_bytes += n;
    for (std::size_t f = 0; f < t.fragment_count(); ++f)
      rung_bytes += t.size_bytes[name.rung * t.fragment_count() + f];
    if (info.tables.bytes != table_bytes || bytes.size() != rung_bytes) return;  // check_textures says so
    auto streams = streams_.find(name.number);
    if (streams == streams_.end())
      streams =
          streams_.try_emplace(name.number, info.codec, t, store_.store().read(info.tables, 0, table_bytes))
              .first;
    streams->second.add_pack(name.rung, std::move(bytes));
    report_.fragments += check_rung(info, t, name.rung, streams->second, context_, findings_);
  }

  CheckedStore& store_;
  const VerifiedDocuments& package_;
  const RunContext& context_;
  Findings& findings_;
  VerifyReport& report_;
  const ManifestScale* coarser_ = nullptr;  // the mesh looked at last
  std::vector<Vec3d> coarser_positions_;
  MeshShare share_;
  std::map<std::uint32_t, PlaneStreams> streams_;  // per plane
};

class Verifier {
 public:
  Verifier(PackageStore& store, const RunContext& context)
      : store_(store, findings_, report_), context_(context) {}

  VerifyReport run() {
    store_.list_entries();
    for (const char* path :
         {kIndexPath, kTablesPath, kTexturesPath, kQualityPath, kAboutPath, kProvenancePath})
      findings_.require(store_.listed().empty() || store_.contains(path), {"entry-set", "E01"}, path, "",
                        "an entry of the package", "none");
    if (read_bootstrap() && read_index_entry()) {
      add_gltf_files();
      store_.check_entry_set(package_.index, package_.manifest.index);
      check_manifest(package_.manifest, findings_);
      check_references(package_.manifest, package_.index, findings_);
      read_documents();
      check_entries();
    }
    report_.findings = findings_.release();
    return std::move(report_);
  }

 private:
  bool read_bootstrap() {
    return guarded(findings_, "manifest", kManifestPath,
                   [&] { package_.manifest = read_manifest(store_.read_manifest()); });
  }

  bool read_index_entry() {
    return guarded(findings_, "index", kIndexPath, [&] {
      const Bytes bytes = store_.read(package_.manifest.index);
      package_.index = read_index(bytes);
      const IndexHead head = read_index_head(bytes);
      check_minor(head.minor, kIndexPath);
      check_head(package_.manifest.index, bytes, head.bytes, "/index");
    });
  }

  void add_gltf_files() {
    for (const EntryRef& e : package_.index)
      findings_.require(!is_gltf_file(e.path), {"index", "H02"}, e.path, "",
                        std::string("to be named by ") + kGltfIndexPath, "by index.bin");
    if (!package_.manifest.gltf) return;
    const EntryRef& gltf = *package_.manifest.gltf;
    package_.index.push_back(gltf);
    guarded(findings_, {"index", "H02"}, kGltfIndexPath, [&] {
      const Bytes bytes = store_.read(gltf);
      check_minor(read_index_head(bytes).minor, kGltfIndexPath);
      for (const EntryRef& e : read_gltf_index(bytes)) package_.index.push_back(e);
    });
    std::ranges::sort(package_.index, {}, &EntryRef::offset);
  }

  void check_minor(int minor, const char* entry) {
    findings_.require_equal(package_.manifest.minor, minor, {"version", "R01"}, entry, "minor version");
  }

  void check_head(const PagedRef& ref, const Bytes& bytes, std::uint64_t head_bytes,
                  const std::string& field) {
    if (!findings_.require_equal(head_bytes, ref.head_bytes, {"reference", "R02"}, kManifestPath,
                                 field + "/headBytes"))
      return;
    findings_.require_equal(to_hex(sha256(std::span(bytes).first(static_cast<std::size_t>(head_bytes)))),
                            to_hex(ref.head_digest), {"reference", "R02"}, kManifestPath,
                            field + "/headSha256");
  }

  void read_documents() {
    guarded(findings_, "textures", kTexturesPath, [&] {
      auto textures = read_textures(store_.read(package_.manifest.textures));
      resolve_textures(textures, package_.index);
      package_.textures = std::move(textures);
    });
    guarded(findings_, "tables", kTablesPath, [&] {
      const Bytes bytes = store_.read(package_.manifest.tables);
      package_.tables = read_tables(bytes);
      const TablesHead head = read_tables_head(bytes);
      check_minor(head.minor, kTablesPath);
      check_head(package_.manifest.tables, bytes, head.bytes, "/tables");
    });
    guarded(findings_, "thesis", kThesisPath, [&] {
      if (!package_.manifest.thesis) return;
      const ThesisFile thesis = read_thesis(store_.read(*package_.manifest.thesis));
      check_minor(thesis.minor, kThesisPath);
      if (package_.tables) check_thesis(package_.manifest, *package_.tables, thesis.tables, findings_);
    });
    guarded(findings_, "quality", kQualityPath, [&] {
      const QualityTable quality = read_quality(store_.read(package_.manifest.quality));
      if (package_.textures) check_quality(package_.manifest, *package_.textures, quality, findings_);
    });
    guarded(findings_, "about", kAboutPath, [&] {
      check_about(package_.manifest, read_about(store_.read(package_.manifest.about)), findings_);
    });
    guarded(findings_, "annotations", kAnnotationsPath, [&] {
      if (package_.manifest.annotations)
        report_.notes =
            count_notes(read_annotations(store_.read(*package_.manifest.annotations)), package_.manifest);
    });
    guarded(findings_, {"provenance", "O03"}, kProvenancePath, [&] {
      const Bytes bytes = store_.read(package_.manifest.provenance);
      parse_json(bytes, kProvenancePath, kMostProvenanceBytes);  // by the rules of all documents
      const Provenance provenance = read_provenance(bytes);
      check_provenance(package_.manifest, package_.textures.value_or(std::vector<TextureInfo>{}), provenance,
                       findings_);
    });
    if (!package_.textures || !package_.tables) return;
    check_planes(*package_.textures, findings_);
    check_textures(package_.manifest, *package_.textures, findings_);
    check_tables(package_.manifest, *package_.textures, *package_.tables, findings_);
    // Streams can be cut out of the packs only where grids and rungs agree.
    for (std::size_t k = 0; k < std::min(package_.textures->size(), package_.tables->planes.size()); ++k) {
      const TextureInfo& info = (*package_.textures)[k];
      const PlaneTables& t = package_.tables->planes[k];
      package_.consistent.push_back(info.columns == t.columns && info.rows == t.rows &&
                                    info.rungs.size() == t.rung_count());
      if (package_.consistent.back()) check_plane_tables(info, static_cast<std::uint32_t>(k), t, findings_);
    }
  }

  void check_entries() {
    EntryVerifier entries(store_, package_, context_, findings_, report_);
    for (std::size_t k = 0; k < package_.index.size(); ++k) {
      context_.check_cancelled();
      context_.report(static_cast<double>(k) / static_cast<double>(package_.index.size()));
      entries.check_entry(package_.index[k]);
    }
    if (store_.store().is_folder()) entries.check_extra_files();
  }

  Findings findings_;
  VerifyReport report_;
  CheckedStore store_;
  const RunContext& context_;
  VerifiedDocuments package_;
};

}  // namespace

VerifyReport verify_package(PackageStore& store, const RunContext& context) {
  return Verifier(store, context).run();
}

}  // namespace texmesh
