#include "format/documents/manifest.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "format/base/json_fields.h"
#include "format/base/text_bytes.h"
#include "format/container/container.h"

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

Json vector_json(Vec3d v) { return Json::array({v.x, v.y, v.z}); }

Json ref_json(const EntryRef& ref) {
  Json j;
  j["offset"] = ref.offset;
  j["bytes"] = ref.bytes;
  j["sha256"] = to_hex(ref.digest);
  return j;
}

Json ref_json(const PagedRef& ref) {
  Json j = ref_json(static_cast<const EntryRef&>(ref));
  j["headBytes"] = ref.head_bytes;
  j["headSha256"] = to_hex(ref.head_digest);
  return j;
}

Json stream_json(const StreamRef& ref) {
  Json j;
  j["offset"] = ref.offset;
  j["bytes"] = ref.bytes;
  j["headBytes"] = ref.head_bytes;
  j["headSha256"] = to_hex(ref.head_digest);
  return j;
}

Json poster_json(const PosterRef& ref) {
  Json j = ref_json(static_cast<const EntryRef&>(ref));
  j["widthPx"] = ref.width_px;
  j["heightPx"] = ref.height_px;
  return j;
}

/// One array per property: as objects, forty scales would spend half of the 16 KiB on names.
Json scales_json(const std::vector<ManifestScale>& scales) {
  Json j;
  for (const char* name :
       {"scale", "triangles", "vertices", "offset", "bytes", "sha256", "major", "errorMax", "errorRms", "p95",
        "p99", "displayPxJnd", "displayPxError", "displayPxEdge", "displayPxFlip", "floor"})
    j[name] = Json::array();
  for (const ManifestScale& s : scales) {
    j["scale"].push_back(s.scale);
    j["triangles"].push_back(s.triangles);
    j["vertices"].push_back(s.vertices);
    j["offset"].push_back(s.glb.offset);
    j["bytes"].push_back(s.glb.bytes);
    j["sha256"].push_back(to_hex(s.glb.digest));
    j["major"].push_back(s.major);
    j["errorMax"].push_back(six_digits(s.error_max));
    j["errorRms"].push_back(six_digits(s.error_rms));
    j["p95"].push_back(six_digits(s.p95));
    j["p99"].push_back(six_digits(s.p99));
    j["displayPxJnd"].push_back(six_digits(s.display_px_jnd));
    j["displayPxError"].push_back(six_digits(s.display_px_error));
    j["displayPxEdge"].push_back(six_digits(s.display_px_edge));
    j["displayPxFlip"].push_back(six_digits(s.display_px_flip));
    j["floor"].push_back(s.floor);
  }
  return j;
}

Json proxies_json(const Manifest& m) {
  Json j;
  j["sizesPx"] = m.proxy_sizes_px;
  for (const char* name :
       {"offset", "bytes", "sha256", "triangles", "vertices", "texturePx", "flip", "flipP95"})
    j[name] = Json::array();
  const auto digits = [](const std::vector<double>& values) {
    Json out = Json::array();
    for (const double v : values) out.push_back(six_digits(v));
    return out;
  };
  for (const ManifestProxy& p : m.proxies) {
    j["offset"].push_back(p.glb.offset);
    j["bytes"].push_back(p.glb.bytes);
    j["sha256"].push_back(to_hex(p.glb.digest));
    j["triangles"].push_back(p.triangles);
    j["vertices"].push_back(p.vertices);
    j["texturePx"].push_back(p.texture_px);
    j["flip"].push_back(digits(p.flip));
    j["flipP95"].push_back(digits(p.flip_p95));
  }
  return j;
}

Json manifest_json(const Manifest& m) {
  Json j;
  j["format"] = "texmesh";
  j["version"]["major"] = m.major;
  j["version"]["minor"] = m.minor;
  j["requiredFeatures"] = m.required_features;
  j["title"] = m.title;
  j["origin"] = vector_json(m.origin);
  j["bounds"]["min"] = vector_json(m.bounds_min);
  j["bounds"]["max"] = vector_json(m.bounds_max);
  j["objectHeight"] = m.object_height;
  j["surfaceArea"] = six_digits(m.surface_area);
  j["jnd"] = m.jnd;
  j["scales"] = scales_json(m.scales);
  j["steps"] = Json::array();
  for (const ManifestStep& s : m.steps) j["steps"].push_back(Json::array({six_digits(s.up_to_px), s.scale}));
  if (!m.proxies.empty()) j["proxies"] = proxies_json(m);
  j["planeCount"] = m.plane_count;
  j["index"] = ref_json(m.index);
  j["tables"] = ref_json(m.tables);
  j["textures"] = ref_json(m.textures);
  j["quality"] = ref_json(m.quality);
  j["provenance"] = ref_json(m.provenance);
  j["about"] = ref_json(m.about);
  if (m.stream) j["stream"] = stream_json(*m.stream);
  if (m.thesis) j["thesis"] = ref_json(*m.thesis);
  if (m.poster) j["poster"] = poster_json(*m.poster);
  return j;
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

Vec3d read_vector(const JsonAt& at) {
  at.array(3, 3);
  return {at[0].number(-kLargest, kLargest), at[1].number(-kLargest, kLargest),
          at[2].number(-kLargest, kLargest)};
}

std::uint64_t read_offset(const JsonAt& at) {
  const std::uint64_t offset = at.by("M05").integer(64);
  if (offset % 64 != 0) at.by("M05").fail("a multiple of 64", std::to_string(offset));
  return offset;
}

void read_ref(const JsonAt& at, const char* path, EntryRef& ref) {
  ref.path = path;
  ref.offset = read_offset(at["offset"]);
  ref.bytes = at["bytes"].integer(1);
  ref.digest = at["sha256"].digest();
}

void read_paged_ref(const JsonAt& at, const char* path, PagedRef& ref) {
  read_ref(at, path, ref);
  ref.head_bytes = at["headBytes"].integer(16, ref.bytes);
  ref.head_digest = at["headSha256"].digest();
}

StreamRef read_stream(const JsonAt& at) {
  StreamRef ref;
  ref.offset = read_offset(at["offset"]);
  ref.bytes = at["bytes"].integer(1);
  ref.head_bytes = at["headBytes"].integer(16, ref.bytes);
  ref.head_digest = at["headSha256"].digest();
  return ref;
}

PosterRef read_poster(const JsonAt& at) {
  PosterRef ref;
  read_ref(at, kPosterPath, ref);
  if (ref.bytes > kMaxPosterBytes)
    at["bytes"].by("O01").fail("at most " + std::to_string(kMaxPosterBytes), std::to_string(ref.bytes));
  ref.width_px = static_cast<std::uint32_t>(at["widthPx"].by("O01").integer(1, kMaxPosterSide));
  ref.height_px = static_cast<std::uint32_t>(at["heightPx"].by("O01").integer(1, kMaxPosterSide));
  return ref;
}

void read_shape(const JsonAt& at, Manifest& m) {
  m.title = at["title"].text(kMaxTitleBytes);
  m.origin = read_vector(at["origin"]);
  const JsonAt bounds = at["bounds"];
  m.bounds_min = read_vector(bounds["min"]);
  m.bounds_max = read_vector(bounds["max"]);
  for (int i = 0; i < 3; ++i)
    if (m.bounds_min[i] > m.bounds_max[i])
      bounds["max"][static_cast<std::size_t>(i)].by("M03").fail("at least the minimum", "less");
  m.object_height = at["objectHeight"].number(0, kLargest);
  m.surface_area = at["surfaceArea"].number(0, kLargest);
  m.jnd = at["jnd"].number(0, 1);
}

void read_scales(const JsonAt& at, Manifest& m) {
  const std::size_t n = at["scale"].array(1, kMaxScales);
  for (const char* column :
       {"triangles", "vertices", "offset", "bytes", "sha256", "major", "errorMax", "errorRms", "p95", "p99",
        "displayPxJnd", "displayPxError", "displayPxEdge", "displayPxFlip", "floor"})
    at[column].by("M10").array(n, n);
  for (std::size_t i = 0; i < n; ++i) {
    ManifestScale s;
    s.scale = static_cast<int>(at["scale"][i].integer(0, kMaxScales - 1));
    if (i == 0 && s.scale != 0) at["scale"][i].by("M10").fail("0", std::to_string(s.scale));
    if (i > 0 && s.scale <= m.scales.back().scale)
      at["scale"][i].by("M10").fail("a rising number", std::to_string(s.scale));
    s.triangles = static_cast<std::uint32_t>(at["triangles"][i].integer(1, 0xffffffffu));
    s.vertices = static_cast<std::uint32_t>(at["vertices"][i].integer(1, 0xffffffffu));
    s.glb = {mesh_path(s.scale), read_offset(at["offset"][i]), at["bytes"][i].integer(1),
             at["sha256"][i].digest()};
    s.major = at["major"][i].boolean();
    s.error_max = at["errorMax"][i].number(0, kLargest);
    s.error_rms = at["errorRms"][i].number(0, kLargest);
    s.p95 = at["p95"][i].number(0, kLargest);
    s.p99 = at["p99"][i].number(0, kLargest);
    s.display_px_jnd = at["displayPxJnd"][i].by("M11").number(0, kAnyDisplayPx);
    s.display_px_error = at["displayPxError"][i].by("M11").number(0, kAnyDisplayPx);
    s.display_px_edge = at["displayPxEdge"][i].by("M11").number(0, kAnyDisplayPx);
    s.display_px_flip = at["displayPxFlip"][i].by("M11").number(0, kAnyDisplayPx);
    s.floor = at["floor"][i].text(kMaxFloorBytes);
    m.scales.push_back(std::move(s));
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

std::vector<double> read_proxy_losses(const JsonAt& at, std::size_t sizes) {
  at.array(sizes, sizes);
  std::vector<double> losses;
  for (std::size_t i = 0; i < sizes; ++i) losses.push_back(at[i].number(0, 1));
  return losses;
}

void read_proxies(const JsonAt& at, Manifest& m) {
  const JsonAt sizes = at["sizesPx"];
  for (std::size_t i = 0, n = sizes.array(1, kMaxProxySizes); i < n; ++i) {
    m.proxy_sizes_px.push_back(sizes[i].number(1, kMaxProxySizePx));
    if (i > 0 && m.proxy_sizes_px[i] <= m.proxy_sizes_px[i - 1]) sizes[i].fail("a rising number", "another");
  }
  const std::size_t n = at["bytes"].array(1, kMaxPackageProxies);
  for (const char* column : {"offset", "sha256", "triangles", "vertices", "texturePx", "flip", "flipP95"})
    at[column].array(n, n);
  for (std::size_t i = 0; i < n; ++i) {
    ManifestProxy p;
    p.glb = {proxy_path(static_cast<std::uint32_t>(i)), read_offset(at["offset"][i]),
             at["bytes"][i].integer(1), at["sha256"][i].digest()};
    if (i > 0 && p.glb.bytes <= m.proxies.back().glb.bytes)
      at["bytes"][i].by("M24").fail("a rising number", std::to_string(p.glb.bytes));
    p.triangles = static_cast<std::uint32_t>(at["triangles"][i].integer(1, 0xffffffffu));
    p.vertices = static_cast<std::uint32_t>(at["vertices"][i].integer(1, 0xffffffffu));
    p.texture_px = static_cast<std::uint32_t>(at["texturePx"][i].integer(0, kMaxProxyTexturePx));
    p.flip = read_proxy_losses(at["flip"][i], m.proxy_sizes_px.size());
    p.flip_p95 = read_proxy_losses(at["flipP95"][i], m.proxy_sizes_px.size());
    m.proxies.push_back(std::move(p));
  }
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

std::string write_manifest(const Manifest& manifest) {
  const std::string json = dump_json(manifest_json(manifest), kManifestFile);
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
  Manifest m;
  read_version(at, m);
  read_shape(at, m);
  read_scales(at["scales"], m);
  read_steps(at["steps"].by("M21"), m);
  if (document.contains("proxies")) read_proxies(at["proxies"].by("M23"), m);
  m.plane_count = static_cast<std::uint32_t>(at["planeCount"].integer(0, kMaxPackagePlanes));
  read_paged_ref(at["index"], kIndexPath, m.index);
  read_paged_ref(at["tables"], kTablesPath, m.tables);
  read_ref(at["textures"], kTexturesPath, m.textures);
  read_ref(at["quality"], kQualityPath, m.quality);
  read_ref(at["provenance"], kProvenancePath, m.provenance);
  read_ref(at["about"], kAboutPath, m.about);
  if (document.contains("stream")) {
    m.stream = read_stream(at["stream"]);
    resolve_stream_scales(at["scales"], m);
  }
  if (document.contains("thesis")) read_ref(at["thesis"], kThesisPath, m.thesis.emplace());
  if (document.contains("poster")) m.poster = read_poster(at["poster"]);
  return m;
}

}  // namespace texmesh
