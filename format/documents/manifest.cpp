#include "format/documents/manifest.h"

#include "format/base/text_bytes.h"
#include "format/container/container.h"
#include "format/documents/json_members.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

const std::string kManifestFile = kManifestPath;
constexpr double kLargest = 1e300;       // of lengths: leaves room for sums
constexpr std::size_t kMaxScales = 100;  // two digits in the path

/// Features that a package may require, one per line (SPEC.md, section 14).
constexpr std::array<std::string_view, 3> kKnownFeatures{
    "codec-jpeg-progressive",
    "codec-jpeg-xy",
    "codec-webp",
};
bool is_known_feature(const std::string& name) {
  return std::ranges::find(kKnownFeatures, name) != kKnownFeatures.end();
}

/// Where an entry's data stand.
void place_members(auto& v, auto& ref) {
  v.by("M05").integer("offset", ref.offset, 64);
  v.by("M05").check("offset", ref.offset % 64 == 0, "a multiple of 64", std::to_string(ref.offset));
  v.integer("bytes", ref.bytes, 1);
}

void ref_members(auto& v, auto& ref) {
  place_members(v, ref);
  v.digest("sha256", ref.digest);
}

void head_members(auto& v, auto& ref) {
  v.integer("headBytes", ref.head_bytes, 16, ref.bytes);
  v.digest("headSha256", ref.head_digest);
}

void poster_members(auto& v, auto& ref) {
  ref_members(v, ref);
  v.by("O01").check("bytes", ref.bytes <= kMaxPosterBytes, "at most " + std::to_string(kMaxPosterBytes),
                    std::to_string(ref.bytes));
  v.by("O01").integer("widthPx", ref.width_px, 1, kMaxPosterSide);
  v.by("O01").integer("heightPx", ref.height_px, 1, kMaxPosterSide);
}

void scale_members(auto& v, auto& s, int before) {
  v.integer("scale", s.scale, 0, kMaxScales - 1);
  v.by("M10").check("scale", before < 0 ? s.scale == 0 : s.scale > before,
                    before < 0 ? "0" : "a rising number", std::to_string(s.scale));
  v.integer("triangles", s.triangles, 1, 0xffffffffu);
  v.integer("vertices", s.vertices, 1, 0xffffffffu);
  ref_members(v, s.glb);
  v.boolean("major", s.major);
  v.measured("errorMax", s.error_max, 0, kLargest);
  v.measured("errorRms", s.error_rms, 0, kLargest);
  v.measured("p95", s.p95, 0, kLargest);
  v.measured("p99", s.p99, 0, kLargest);
  v.by("M11").measured("displayPxJnd", s.display_px_jnd, 0, kAnyDisplayPx);
  v.by("M11").measured("displayPxError", s.display_px_error, 0, kAnyDisplayPx);
  v.by("M11").measured("displayPxEdge", s.display_px_edge, 0, kAnyDisplayPx);
  v.by("M11").measured("displayPxFlip", s.display_px_flip, 0, kAnyDisplayPx);
  v.text("floor", s.floor, kMaxFloorBytes);
}

void proxies_members(auto& v, auto& m) {
  v.rising("sizesPx", m.proxy_sizes_px, kMaxProxySizes, 1, kMaxProxySizePx);
  const std::size_t sizes = m.proxy_sizes_px.size();
  v.rows("bytes", m.proxies, 1, kMaxPackageProxies, [&](auto& row, auto& p, std::size_t i) {
    ref_members(row, p.glb);
    row.by("M24").check("bytes", i == 0 || p.glb.bytes > m.proxies[i - 1].glb.bytes, "a rising number",
                        std::to_string(p.glb.bytes));
    row.integer("triangles", p.triangles, 1, 0xffffffffu);
    row.integer("vertices", p.vertices, 1, 0xffffffffu);
    row.integer("texturePx", p.texture_px, 0, kMaxProxyTexturePx);
    row.measured("flip", p.flip, sizes, sizes, 1);
    row.measured("flipP95", p.flip_p95, sizes, sizes, 1);
  });
}

/// What stands before the steps.
void shape_members(auto& v, auto& m) {
  v.text("title", m.title, kMaxTitleBytes);
  v.vector("origin", m.origin, kLargest);
  v.object("bounds", [&](auto& bounds) {
    bounds.vector("min", m.bounds_min, kLargest);
    bounds.vector("max", m.bounds_max, kLargest);
  });
  v.number("objectHeight", m.object_height, 0, kLargest);
  v.measured("surfaceArea", m.surface_area, 0, kLargest);
  v.number("jnd", m.jnd, 0, 1);
  v.object("scales", [&](auto& columns) {
    columns.by("M10").rows("scale", m.scales, 1, kMaxScales, [&](auto& row, auto& s, std::size_t i) {
      scale_members(row, s, i > 0 ? m.scales[i - 1].scale : -1);
    });
  });
}

/// What stands behind them.
void entry_members(auto& v, auto& m) {
  const auto optional = [&v](const char* name, auto& value, auto&& describe) {
    if (!v.has(name, value.has_value())) return;
    if constexpr (requires { value.emplace(); }) value.emplace();
    v.object(name, [&](auto& inner) { describe(inner, *value); });
  };
  const auto ref = [](auto& inner, auto& r) { ref_members(inner, r); };
  if (v.has("proxies", !m.proxies.empty()))
    v.by("M23").object("proxies", [&](auto& inner) { proxies_members(inner, m); });
  v.integer("planeCount", m.plane_count, 0, kMaxPackagePlanes);
  for (const auto& [name, paged] : {std::pair("index", &m.index), std::pair("tables", &m.tables)})
    v.object(name, [&, to = paged](auto& inner) {
      ref_members(inner, *to);
      head_members(inner, *to);
    });
  for (const auto& [name, entry] : {std::pair("textures", &m.textures), std::pair("quality", &m.quality),
                                    std::pair("provenance", &m.provenance), std::pair("about", &m.about)})
    v.object(name, [&, to = entry](auto& inner) { ref_members(inner, *to); });
  optional("stream", m.stream, [](auto& inner, auto& stream) {
    place_members(inner, stream);
    head_members(inner, stream);
  });
  optional("thesis", m.thesis, ref);
  optional("poster", m.poster, [](auto& inner, auto& poster) { poster_members(inner, poster); });
  optional("annotations", m.annotations, ref);
  if (m.annotations)
    v.by("N05").check("annotations", m.minor >= 1, "version 2.1 or later", "2." + std::to_string(m.minor));
  optional("gltf", m.gltf, ref);
  if (m.gltf) v.by("H01").check("gltf", m.minor >= 1, "version 2.1 or later", "2." + std::to_string(m.minor));
}

void read_version(const JsonAt& at, Manifest& m) {
  const std::string format = at["format"].by("M01").text(100);
  if (format != "texmesh") at["format"].by("M01").fail("texmesh", format);
  const JsonAt version = at["version"].by("M01");
  m.major = static_cast<int>(version["major"].integer(0, 1'000'000));
  m.minor = static_cast<int>(version["minor"].integer(0, 1'000'000));
  if (m.major != kFormatMajor)
    version["major"].by("W03").fail(std::to_string(kFormatMajor), describe_other_major(m.major));
  const JsonAt features = at["requiredFeatures"];
  for (std::size_t i = 0, n = features.array(0, 100); i < n; ++i) {
    m.required_features.push_back(features[i].text(100));
    if (!is_known_feature(m.required_features.back()))
      features[i].by("M02").fail("a feature that this reader knows", m.required_features.back());
  }
}

void read_steps(const JsonAt& at, Manifest& m) {
  const std::size_t n = at.array(1, kMaxScales);
  for (std::size_t i = 0; i < n; ++i) {
    at[i].array(2, 2);
    const ManifestStep s{at[i][0].number(0, kAnyDisplayPx),
                         static_cast<int>(at[i][1].integer(0, kMaxScales))};
    if (std::ranges::none_of(m.scales, [&](const ManifestScale& k) { return k.scale == s.scale; }))
      at[i][1].fail("a scale of the package", std::to_string(s.scale));
    if (i > 0 && s.up_to_px <= m.steps.back().up_to_px) at[i][0].fail("a rising number", "another");
    if (i > 0 && s.scale >= m.steps.back().scale) at[i][1].fail("a finer scale", std::to_string(s.scale));
    m.steps.push_back(s);
  }
  if (m.steps.back().up_to_px != kAnyDisplayPx) at[n - 1][0].fail("1e9", "less");
  if (m.steps.back().scale != 0) at[n - 1][1].fail("0", std::to_string(m.steps.back().scale));
}

/// What the places of entries say of their paths.
void set_paths(Manifest& m) {
  for (ManifestScale& s : m.scales) s.glb.path = mesh_path(s.scale);
  for (std::size_t k = 0; k < m.proxies.size(); ++k)
    m.proxies[k].glb.path = proxy_path(static_cast<std::uint32_t>(k));
  m.index.path = kIndexPath;
  m.tables.path = kTablesPath;
  m.textures.path = kTexturesPath;
  m.quality.path = kQualityPath;
  m.provenance.path = kProvenancePath;
  m.about.path = kAboutPath;
  if (m.thesis) m.thesis->path = kThesisPath;
  if (m.poster) m.poster->path = kPosterPath;
  if (m.annotations) m.annotations->path = kAnnotationsPath;
  if (m.gltf) m.gltf->path = kGltfIndexPath;
}

/// Scales whose column says the stream's offset are prefixes of it.
void resolve_stream_scales(const JsonAt& at, Manifest& m) {
  std::uint64_t before = m.stream->head_bytes;
  for (std::size_t i = m.scales.size(); i-- > 0;) {
    EntryRef& ref = m.scales[i].glb;
    if (ref.offset != m.stream->offset) continue;
    if (i == 0 || i + 1 == m.scales.size())
      at["offset"][i].by("M18").fail("a GLB of the finest and of the coarsest scale", "the stream");
    if (ref.bytes <= before || ref.bytes > m.stream->bytes)
      at["bytes"][i].by("M19").fail("more than " + std::to_string(before) + " bytes, at most the stream's",
                                    std::to_string(ref.bytes));
    before = ref.bytes;
    ref.path = kSplitStreamPath;
  }
}

}  // namespace

const EntryRef& first_picture(const Manifest& manifest) {
  return manifest.proxies.empty() ? manifest.scales.back().glb : manifest.proxies.front().glb;
}

std::uint64_t start_bytes(const Manifest& manifest) {
  const EntryRef& first = first_picture(manifest);
  return first.offset + first.bytes;
}

std::string write_manifest(const Manifest& m) {
  Json j;
  j["format"] = "texmesh";
  j["version"]["major"] = m.major;
  j["version"]["minor"] = m.minor;
  j["requiredFeatures"] = m.required_features;
  MemberWriter to(j);
  shape_members(to, m);
  j["steps"] = Json::array();
  for (const ManifestStep& s : m.steps) j["steps"].push_back(Json::array({six_digits(s.up_to_px), s.scale}));
  entry_members(to, m);
  const std::string json = dump_json(j, kManifestFile);
  const std::uint64_t room = kBootstrapBytes - ContainerWriter::data_offset(0, kManifestPath, json.size());
  if (json.size() > room)
    throw RuleError("K12", kManifestFile, "", "at most " + std::to_string(room) + " bytes",
                    std::to_string(json.size()) + " bytes");
  read_manifest(text_bytes(json));
  return json;
}

Manifest read_manifest(std::span<const std::uint8_t> json) {
  const nlohmann::json document = parse_json(json, kManifestFile, kBootstrapBytes);
  const JsonAt at(document, kManifestFile);
  const MemberReader from(at);
  Manifest m;
  read_version(at, m);
  shape_members(from, m);
  for (int i = 0; i < 3; ++i)
    if (m.bounds_min[i] > m.bounds_max[i])
      at["bounds"]["max"][static_cast<std::size_t>(i)].by("M03").fail("at least the minimum", "less");
  read_steps(at["steps"].by("M21"), m);
  entry_members(from, m);
  set_paths(m);
  if (m.stream) resolve_stream_scales(at["scales"], m);
  return m;
}

}  // namespace texmesh
