#include "tools/inspect/verify/verify_entries.h"

#include <algorithm>

#include "format/container/format_version.h"
#include "stages/jpeg/jpeg.h"
#include "tools/inspect/fragment_files.h"
#include "tools/inspect/verify/verify_checks.h"
#include "tools/inspect/verify/verify_guard.h"

namespace texmesh {

void EntryVerifier::check_entry(const EntryRef& e) {
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
  } else if (name.kind == EntryKind::kThesis) {
    findings_.require(package_.manifest.thesis.has_value(), {"entry-set", "E03"}, e.path, "",
                      "to be named by the manifest", "not there");
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

void EntryVerifier::check_mesh_entry(const EntryRef& e, int number) {
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

void EntryVerifier::check_proxy_entry(const EntryRef& e, std::size_t number) {
  const Bytes bytes = store_.read(e);
  const std::vector<ManifestProxy>& proxies = package_.manifest.proxies;
  if (!findings_.require(number < proxies.size(), "entry-set", e.path, "", "to be named by the manifest",
                         "not there"))
    return;
  ++report_.meshes;
  check_proxy(package_.manifest, proxies[number], bytes, findings_);
}

void EntryVerifier::check_texture_entry(const EntryRef& e, const EntryName& name) {
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

void EntryVerifier::check_source_entry(const EntryRef& e, const EntryName& name) {
  Bytes bytes = store_.read(e);
  if (!package_.textures) return;
  const bool named = name.number < package_.textures->size() &&
                     (*package_.textures)[name.number].source_extension == name.extension;
  if (findings_.require(named, {"entry-set", "E03"}, e.path, "", "to be named by textures.json", "not there"))
    check_source((*package_.textures)[name.number], std::move(bytes), findings_);
}

void EntryVerifier::check_poster_entry(const EntryRef& e) {
  const Bytes bytes = store_.read(e);
  const std::optional<PosterRef>& poster = package_.manifest.poster;
  if (!findings_.require(poster.has_value(), {"entry-set", "E03"}, e.path, "", "to be named by the manifest",
                         "not there"))
    return;
  const Pixels pixels = decode_jpeg(bytes, std::uint64_t{kMaxPosterSide} * kMaxPosterSide);
  findings_.require_equal(poster->width_px, pixels.width_px, {"poster", "O01"}, e.path, "width");
  findings_.require_equal(poster->height_px, pixels.height_px, {"poster", "O01"}, e.path, "height");
}

void EntryVerifier::check_rung_entry(const TextureInfo& info, const PlaneTables& t, const EntryName& name,
                                     Bytes bytes) {
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

void EntryVerifier::check_extra_files() {
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

}  // namespace texmesh
