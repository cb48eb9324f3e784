#include "stages/package/package.h"

#include <set>

#include "format/base/text_bytes.h"
#include "format/documents/package_writer.h"
#include "format/rules/viewing.h"
#include "stages/base/run_context.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/gltf/glb_container.h"
#include "stages/image/decode_image.h"

namespace texmesh {
namespace {

[[noreturn]] void fail(const std::string& place, const std::string& expected, const std::string& found) {
  throw StageError("package", place, expected, found);
}

std::string plane_place(std::size_t plane) { return "texture plane " + std::to_string(plane); }

Bytes to_bytes(const std::string& s) { return {s.begin(), s.end()}; }

/// Stage results must belong together before anything is read from them by index.
void check_inputs(const NestedScales& scales, const PerceptualValues& perceptual,
                  const std::vector<Image>& images, const Fragments& fragments, const Ladder& ladder,
                  const Previews& previews, const PackageTables& tables, const ScaleFiles& files) {
  const std::size_t n = scales.scales.size(), planes = fragments.planes.size();
  const auto require = [](const std::string& what, std::size_t expected, std::size_t found) {
    if (expected != found) fail(what, std::to_string(expected), std::to_string(found));
  };
  if (n == 0 || scales.scales.front().scale != 0) fail("scales", "S_0 first", "none");
  require("perceptual values p95", n * n, perceptual.p95.size());
  require("perceptual values p99", n * n, perceptual.p99.size());
  require("perceptual values major", n, perceptual.major.size());
  require("perceptual values kept", n, perceptual.kept.size());
  for (const auto* v :
       {&perceptual.display_px_edge, &perceptual.display_px_error, &perceptual.display_px_jnd})
    require("displayed sizes", n, v->size());
  require("planes of the ladder", planes, ladder.planes.size());
  require("planes of the previews", planes, previews.planes.size());
  require("planes of the tables", planes, tables.planes.size());
  if (files.files.empty()) fail("scale files", "at least one", "none");
  for (std::size_t p = 0; p < planes; ++p) {
    if (fragments.planes[p].image >= images.size()) fail(plane_place(p), "an image of the model", "none");
    if (fragments.planes[p].mip > 0 && fragments.planes[p].base >= p)
      fail(plane_place(p), "a mip of a plane before it", std::to_string(fragments.planes[p].base));
    if ((fragments.planes[p].mip > 0) != previews.planes[p].file.empty())
      fail(plane_place(p), "a preview for full-size planes, none for mips",
           std::to_string(previews.planes[p].file.size()) + " bytes");
    const PlaneTables& t = tables.planes[p];
    require(plane_place(p) + ": rungs of the ladder", t.rung_count(), ladder.planes[p].rungs.size());
    require(plane_place(p) + ": fragments", fragments.planes[p].fragment_count(), t.fragment_count());
    for (const LadderRung& rung : ladder.planes[p].rungs)
      require(plane_place(p) + ": offsets of a rung", t.fragment_count() + 1, rung.offset.size());
  }
}

std::size_t index_of_scale(const NestedScales& scales, int scale) {
  const auto it = std::ranges::find(scales.scales, scale, &NestedScale::scale);
  if (it == scales.scales.end())
    fail("scale files", "files of nested scales", "scale " + std::to_string(scale));
  return static_cast<std::size_t>(it - scales.scales.begin());
}

double displayed(float px) { return std::clamp(static_cast<double>(px), 0.0, kAnyDisplayPx); }

double displayed_by_pictures(const MeasuredQuality& quality, int scale) {
  const std::vector<int>& measured = quality.table.scales;
  const auto it = std::ranges::find(measured, scale);
  if (it == measured.end() || quality.display_px_flip.size() != measured.size())
    fail("quality", "a displayed height of scale " + std::to_string(scale), "none");
  return displayed(quality.display_px_flip[static_cast<std::size_t>(it - measured.begin())]);
}

std::vector<ManifestScale> describe_scales(const NestedScales& scales, const PerceptualValues& perceptual,
                                           const ScaleFiles& files, const MeasuredQuality& quality) {
  std::vector<ManifestScale> result;
  for (const ScaleFile& file : files.files) {
    const std::size_t k = index_of_scale(scales, file.scale);
    const NestedScale& nested = scales.scales[k];
    ManifestScale s;
    s.scale = file.scale;
    s.triangles = file.triangles;
    s.vertices = file.vertices;
    s.glb.path = file.glb.empty() ? kSplitStreamPath : mesh_path(file.scale);
    s.major = perceptual.major[k] != 0;
    s.error_max = static_cast<double>(nested.error_max);
    s.error_rms = static_cast<double>(nested.error_rms);
    s.floor = nested.floor_reason;
    s.p95 = k == 0 ? 0 : static_cast<double>(perceptual.p95[k]);  // row 0: from S_0
    s.p99 = k == 0 ? 0 : static_cast<double>(perceptual.p99[k]);
    s.display_px_jnd = k == 0 ? kAnyDisplayPx : displayed(perceptual.display_px_jnd[k]);
    s.display_px_error = k == 0 ? kAnyDisplayPx : displayed(perceptual.display_px_error[k]);
    s.display_px_edge = k == 0 ? kAnyDisplayPx : displayed(perceptual.display_px_edge[k]);
    s.display_px_flip = k == 0 ? kAnyDisplayPx : displayed_by_pictures(quality, file.scale);
    result.push_back(std::move(s));
  }
  std::ranges::sort(result, {}, &ManifestScale::scale);
  if (result.front().scale != 0) fail("scale files", "S_0", "none");
  return result;
}

/// What `perceptual` says of any two scales, as thesis.bin has it.
PerceptualTable describe_perceptual(const NestedScales& scales, const PerceptualValues& perceptual) {
  PerceptualTable t;
  const std::size_t n = scales.scales.size();
  if (perceptual.step.size() != n || perceptual.chain_average.size() != n * n)
    fail("perceptual values", std::to_string(n) + " scales", std::to_string(perceptual.step.size()));
  for (std::size_t i = 0; i < n; ++i) {
    const CollapseStatistics& step = perceptual.step[i];
    t.scale.push_back(static_cast<std::uint8_t>(scales.scales[i].scale));
    t.triangles.push_back(static_cast<std::uint32_t>(scales.scales[i].triangles.size()));
    t.collapses.push_back(step.collapses);
    t.average.push_back(step.mean), t.largest.push_back(step.max), t.least.push_back(step.min);
    t.deviation.push_back(step.deviation);
    for (std::size_t j = i + 1; j < n; ++j) {
      t.p95.push_back(perceptual.p95[i * n + j]);
      t.chain_average.push_back(perceptual.chain_average[i * n + j]);
      t.chain_largest.push_back(perceptual.chain_largest[i * n + j]);
      t.chain_least.push_back(perceptual.chain_least[i * n + j]);
    }
  }
  return t;
}

Manifest describe_model(const NestedScales& scales, const PerceptualValues& perceptual,
                        const ScaleFiles& files, const Fragments& fragments, const MeasuredQuality& quality,
                        double jnd, const std::string& title) {
  Manifest m;
  m.title = title;
  m.origin = scales.mesh.origin;
  const auto& positions = scales.mesh.positions;
  if (positions.empty()) fail("mesh", "positions", "none");
  const Box3d box = to_double(bounding_box(positions));
  m.bounds_min = box.min;
  m.bounds_max = box.max;
  m.object_height = static_cast<double>(perceptual.object_height);
  m.surface_area = surface_area(scales.mesh, scales.scales.front().triangles);
  m.jnd = jnd;
  m.scales = describe_scales(scales, perceptual, files, quality);
  m.steps = step_function(m.scales, StepRule::kFlip);
  m.plane_count = static_cast<std::uint32_t>(fragments.planes.size());
  return m;
}

/// `preview` is that of the full-size plane.
TextureInfo describe_texture(const TexturePlane& plane, const PlaneLadder& ladder,
                             const PlanePreview& preview, const std::vector<Image>& images) {
  TextureInfo t;
  t.image = plane.image;
  t.mip = plane.mip;
  t.base = plane.base;
  t.role = enum_name(plane.role);
  t.name = clean_text(images[plane.image].name, 200);
  t.colour_space = is_colour(plane.role) ? "srgb" : "linear";
  t.codec = ladder.codec;
  t.width_px = plane.width_px;
  t.height_px = plane.height_px;
  t.channels = plane.channels;
  t.fragment_width_px = plane.fragment_width_px;
  t.fragment_height_px = plane.fragment_height_px;
  t.columns = plane.columns;
  t.rows = plane.rows;
  t.grid_reason = clean_text(plane.grid_reason, 1000);
  t.preview_width_px = preview.width_px;
  t.preview_height_px = preview.height_px;
  for (const LadderRung& rung : ladder.rungs) t.rung_quality.push_back(rung.quality);
  t.source_rung = ladder.source_rung;
  if (ladder.source != SourceFile::kNone) t.source_extension = image_extension(images[plane.image].format);
  t.source_colours = ladder.source != SourceFile::kOtherColours;
  return t;
}

/// What a reader must know to show the textures, each once, by name.
std::vector<std::string> required_features(const Ladder& ladder) {
  std::set<std::string> features;
  for (const PlaneLadder& plane : ladder.planes) features.emplace(codec_traits(plane.codec).required_feature);
  features.erase("");
  return {features.begin(), features.end()};
}

/// The fragments of a rung in the order of their importance, so that a prefix of the entry is worth the most.
Bytes pack_rung(const LadderRung& rung, const PlaneTables& tables, std::size_t r, std::size_t plane) {
  Bytes pack;
  for (const std::uint16_t f : tables.order) {
    if (f >= tables.fragment_count()) fail(plane_place(plane), "fragments in the order", std::to_string(f));
    const std::uint64_t begin = rung.offset[f], end = rung.offset[f + std::size_t{1}];
    if (begin > end || end > rung.data.size())
      fail(plane_place(plane), "offsets within the rung", std::to_string(end));
    if (end - begin != tables.size_bytes[r * tables.fragment_count() + f])
      fail(plane_place(plane) + ", fragment " + std::to_string(f),
           std::to_string(tables.size_bytes[r * tables.fragment_count() + f]) + " bytes, as the tables say",
           std::to_string(end - begin));
    pack.insert(pack.end(), rung.data.begin() + static_cast<std::ptrdiff_t>(begin),
                rung.data.begin() + static_cast<std::ptrdiff_t>(end));
  }
  return pack;
}

/// Rows of the manifest's scales in tables that have one for every scale of the chain.
std::vector<std::size_t> stored_rows(const Manifest& manifest, const PackageTables& tables) {
  std::vector<std::size_t> rows;
  for (const ManifestScale& s : manifest.scales) {
    rows.push_back(static_cast<std::size_t>(s.scale));
    for (std::size_t p = 0; p < tables.planes.size(); ++p)
      if (tables.planes[p].scale_count() <= rows.back())
        fail(plane_place(p), "tables of scale " + std::to_string(s.scale),
             std::to_string(tables.planes[p].scale_count()) + " scales");
  }
  return rows;
}

void add_texture_entries(const PlaneLadder& ladder, const PlanePreview& preview, const PlaneTables& tables,
                         std::size_t plane, std::vector<PackageEntry>& entries) {
  const auto p = static_cast<std::uint32_t>(plane);
  if (!preview.file.empty()) entries.push_back({preview_path(p), preview.file});
  Bytes streams;
  for (std::size_t r = 0; r < ladder.rungs.size(); ++r) {
    const LadderRung& rung = ladder.rungs[r];
    if (rung.table_stream.size() != tables.table_bytes[r] || rung.quality != tables.rung_quality[r])
      fail(plane_place(plane) + ", rung " + std::to_string(r), "size and quality as the tables say",
           "others");
    streams.insert(streams.end(), rung.table_stream.begin(), rung.table_stream.end());
    entries.push_back({rung_path(p, static_cast<std::uint32_t>(r)), pack_rung(rung, tables, r, plane)});
  }
  entries.push_back({table_streams_path(p), std::move(streams)});
}

/// The figures of proxies stand in the manifest.
void add_proxies(const Proxies& proxies, Manifest& manifest, std::vector<PackageEntry>& entries) {
  for (std::size_t k = 0; k < proxies.proxies.size(); ++k) {
    const Proxy& proxy = proxies.proxies[k];
    ManifestProxy described;
    described.triangles = proxy.triangles;
    described.vertices = proxy.vertices;
    for (const ProxyTexture& t : proxy.textures)
      described.texture_px = std::max({described.texture_px, t.width_px, t.height_px});
    std::vector<double> sizes_px;
    for (const ProxyPictureLoss& loss : proxy.losses) {
      sizes_px.push_back(loss.displayed_px);
      described.flip.push_back(loss.flip_mean);
      described.flip_p95.push_back(loss.flip_p95);
    }
    if (k > 0 && sizes_px != manifest.proxy_sizes_px)
      fail("proxy " + std::to_string(k), "the displayed heights of the first", "others");
    manifest.proxy_sizes_px = std::move(sizes_px);
    manifest.proxies.push_back(std::move(described));
    entries.push_back({proxy_path(static_cast<std::uint32_t>(k)), proxy.glb});
  }
}

/// What the source says, what the publisher says over it, and the title over both.
About describe_object(const About& source, const PackageOptions& options) {
  About over;
  if (!options.meta.empty()) over = read_about(to_bytes(options.meta));
  if (!options.title.empty()) over.title = options.title;
  return merge_about(source, over);
}

/// provenance.json tells the package's version.
std::string with_minor(const std::string& provenance_json, int minor) {
  if (minor == 0) return provenance_json;
  auto json = nlohmann::ordered_json::parse(provenance_json);
  json["format"]["minor"] = minor;
  return json.dump();
}

}  // namespace

std::vector<std::uint8_t> assemble_package(const NestedScales& scales, const PerceptualValues& perceptual,
                                           const std::vector<Image>& images, const Fragments& fragments,
                                           const Ladder& ladder, const Previews& previews,
                                           const PackageTables& tables, const ThesisTables& thesis,
                                           const ScaleFiles& files, const GltfScales& gltf,
                                           const MeasuredQuality& quality, const Poster& poster,
                                           const Proxies& proxies, const About& source, double jnd,
                                           const std::string& provenance_json, const PackageOptions& options,
                                           const RunContext& context) {
  check_inputs(scales, perceptual, images, fragments, ladder, previews, tables, files);
  const About about = describe_object(source, options);
  Manifest manifest = describe_model(scales, perceptual, files, fragments, quality, jnd, about.title);
  manifest.required_features = required_features(ladder);
  std::vector<TextureInfo> textures;
  std::vector<PackageEntry> entries;
  manifest.minor = std::max(needed_minor(tables), options.annotations.empty() && gltf.files.empty() ? 0 : 1);
  entries.push_back(
      {kTablesPath, write_tables(select_scales(tables, stored_rows(manifest, tables)), manifest.minor)});
  entries.push_back(
      {kThesisPath, write_thesis({thesis.planes, describe_perceptual(scales, perceptual)}, manifest.minor)});
  entries.push_back({kQualityPath, to_bytes(write_quality(quality.table))});
  entries.push_back({kProvenancePath, to_bytes(with_minor(provenance_json, manifest.minor))});
  entries.push_back({kAboutPath, to_bytes(write_about(about))});
  if (!options.annotations.empty()) {
    read_annotations(text_bytes(options.annotations));
    entries.push_back({kAnnotationsPath, to_bytes(options.annotations)});
  }
  for (const ScaleFile& file : files.files)
    if (!file.glb.empty())
      entries.push_back({mesh_path(file.scale), with_copyright(file.glb, copyright_line(source))});
  for (const GltfScales::File& file : gltf.files)
    entries.push_back({file.path, parse_entry_path(file.path).kind == EntryKind::kGltfScale
                                      ? with_copyright(file.bytes, copyright_line(source))
                                      : file.bytes});
  if (!poster.file.empty()) {
    manifest.poster = PosterRef{{}, poster.width_px, poster.height_px};
    entries.push_back({kPosterPath, poster.file});
  }
  add_proxies(proxies, manifest, entries);
  if (!files.stream.empty()) entries.push_back({kSplitStreamPath, files.stream});
  for (std::size_t p = 0; p < fragments.planes.size(); ++p) {
    context.check_cancelled();
    const TexturePlane& plane = fragments.planes[p];
    const std::size_t base = plane.mip > 0 ? plane.base : p;
    textures.push_back(describe_texture(plane, ladder.planes[p], previews.planes[base], images));
    add_texture_entries(ladder.planes[p], previews.planes[p], tables.planes[p], p, entries);
    if (const std::string& extension = textures.back().source_extension; !extension.empty())
      entries.push_back({source_path(static_cast<std::uint32_t>(p), extension), images[plane.image].bytes});
  }
  context.check_cancelled();
  std::vector<std::uint8_t> package = write_package(manifest, std::move(textures), entries);
  context.report(1);
  return package;
}

}  // namespace texmesh
