#include "tests/support/packages.h"
#include "tests/support/all_rungs.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "format/container/container.h"
#include "format/container/layout.h"
#include "format/documents/index.h"
#include "format/documents/package_writer.h"
#include "format/rules/allocation.h"
#include "stages/base/run_context.h"
#include "stages/ladder/ladder.h"
#include "stages/previews/previews.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {
namespace {

using nlohmann::json;

void put_u32(Bytes& out, std::uint32_t v) {
  for (int k = 0; k < 4; ++k) out.push_back(static_cast<std::uint8_t>(v >> (8 * k)));
}

template <class T>
std::size_t append(Bytes& out, const std::vector<T>& values) {
  while (out.size() % 4) out.push_back(0);
  const std::size_t at = out.size();
  out.resize(at + values.size() * sizeof(T));
  std::memcpy(out.data() + at, values.data(), values.size() * sizeof(T));
  return at;
}

template <class T>
std::size_t add_view(GlbParts& g, const std::vector<T>& values) {
  const std::size_t at = append(g.binary, values);
  g.json["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", at}, {"byteLength", values.size() * sizeof(T)}});
  return g.json["bufferViews"].size() - 1;
}

std::size_t add_accessor(GlbParts& g, std::size_t view, int component, const char* type, std::size_t count) {
  g.json["accessors"].push_back(
      {{"bufferView", view}, {"componentType", component}, {"type", type}, {"count", count}});
  return g.json["accessors"].size() - 1;
}

/// A picture with detail that differs between its quarters.
Pixels picture(std::uint32_t width, std::uint32_t height) {
  Pixels p{width, height, 3, {}};
  Random random{7};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x)
      for (std::uint32_t c = 0; c < 3; ++c)
        p.data.push_back(
            static_cast<std::uint8_t>(40 + 2 * y + c * 20 + random.next() % (x < width / 2 ? 4 : 60)));
  return p;
}

constexpr std::uint32_t kFragments = 4, kStored = 3;

TexturePlane make_plane() {
  TexturePlane plane;
  plane.width_px = 64, plane.height_px = 48, plane.channels = 3;
  plane.fragment_width_px = plane.fragment_height_px = 32;
  plane.columns = plane.rows = 2;
  plane.grid_reason = "a test's";
  plane.coverage.assign(8 * 48, 0xff);
  for (std::size_t y = 32; y < 48; ++y)
    std::fill_n(plane.coverage.begin() + static_cast<std::ptrdiff_t>(y * 8 + 4), 4, std::uint8_t{0});
  plane.covered_texels = {1024, 1024, 512, 0};
  plane.surface_fraction = {0.5f, 0.25f, 0.25f, 0};
  plane.features = {5, 9, 7, 0, 4, 4, 8, 0};
  return plane;
}

PlaneTables make_tables(const TexturePlane& plane, const PlaneLadder& ladder) {
  PlaneTables t;
  t.columns = plane.columns, t.rows = plane.rows;
  t.covered_texels = plane.covered_texels;
  t.surface_fraction = plane.surface_fraction;
  t.features = plane.features;
  t.skip_dssim = {1, 1, 1, 0};
  t.order = {1, 2, 0};  // eta_0 = 0, 1, 0.5
  t.quality = {80, 40};
  for (const LadderRung& rung : ladder.rungs) {
    t.rung_quality.push_back(static_cast<std::uint8_t>(rung.quality));
    t.table_bytes.push_back(static_cast<std::uint32_t>(rung.table_stream.size()));
    for (std::uint32_t f = 0; f < kFragments; ++f) {
      const std::span stream(rung.data.data() + rung.offset[f], rung.offset[f + 1] - rung.offset[f]);
      t.size_bytes.push_back(static_cast<std::uint32_t>(stream.size()));
      t.digest.push_back(f < kStored ? truncated(sha256(stream)) : 0);
      t.mse.push_back(f < kStored ? 2000.0f / static_cast<float>(rung.quality) : 0);
      t.dssim.push_back(f < kStored ? 0.25f : 0);
    }
  }
  return t;
}

/// Of scales 0 to 5; sizes of those between are made up.
PlaneThesis make_thesis(const PlaneTables& t) {
  PlaneThesis out;
  for (auto* v : {&out.z, &out.i, &out.zeta, &out.m, &out.vqp}) *v = {0.25f, 0.5f, 0.75f, 0};
  out.models = {{300, 0.5f, 0.98f}, {300, 0.5f, 0.98f}, {300, 0.5f, 0.98f}, {}};
  for (std::size_t scale = 0; scale <= 5; ++scale) {
    out.quality.push_back(80 - 8 * static_cast<float>(scale));
    for (int g = 0; g <= 20; ++g)
      out.total_bytes.push_back(scale % 5 == 0 ? bytes_asked_for(t, scale / 5, g / 20.0) : 1000);
  }
  return out;
}

/// Of the chain S_0 to S_5, of which S_0 and S_5 are stored.
PerceptualTable make_perceptual() {
  PerceptualTable t;
  for (std::uint8_t k = 0; k <= 5; ++k) {
    t.scale.push_back(k);
    t.triangles.push_back(static_cast<std::uint32_t>(k == 0   ? fine_mesh().triangles.size()
                                                     : k == 5 ? coarse_mesh().triangles.size()
                                                              : 100u));
    t.collapses.push_back(k == 0 ? 0 : 7);
    for (auto* v : {&t.average, &t.largest, &t.least, &t.deviation}) v->push_back(k == 0 ? 0 : 0.03f);
    for (std::uint8_t j = static_cast<std::uint8_t>(k + 1); j <= 5; ++j) {
      t.p95.push_back(0.01f * static_cast<float>(j - k));
      for (auto* v : {&t.chain_average, &t.chain_largest, &t.chain_least}) v->push_back(0.02f);
    }
  }
  return t;
}

json make_provenance() {
  const std::string digest(64, '5');
  return {{"version", 1},
          {"tool", "texmesh test"},
          {"format", {{"major", kFormatMajor}, {"minor", 0}}},
          {"inputs", {{{"role", "model"}, {"sha256", digest}, {"bytes", 4321}}}},
          {"options",
           {{"version", 1}, {"package", {{"title", "Two spheres"}}}, {"ladder", {{"rungs", {20, 70}}}}}},
          {"stages", {{"ssf", 1}}},
          {"libraries", {{"draco", "1.5.5"}}}};
}

void add_texture(PackageParts& p) {
  const TexturePlane plane = make_plane();
  Fragments fragments;
  fragments.scales = 1;
  fragments.planes = {plane};
  LadderOptions options = testing::all_rungs();
  options.rungs = {20, 70};
  const std::vector<Pixels> pixels{picture(64, 64)};
  const PlaneLadder ladder = encode_ladder(fragments, pixels, {}, {}, options, {}).planes.at(0);
  const PlanePreview preview = make_previews(fragments, pixels, {}, {}).planes.at(0);
  p.tables.planes = {make_tables(plane, ladder)};
  p.thesis.planes = {make_thesis(p.tables.planes[0])};
  p.thesis.perceptual = make_perceptual();
  p.streams[preview_path(0)] = preview.file;
  for (std::uint32_t r = 0; r < 2; ++r) {
    const LadderRung& rung = ladder.rungs[r];
    Bytes& tables = p.streams[table_streams_path(0)];
    tables.insert(tables.end(), rung.table_stream.begin(), rung.table_stream.end());
    Bytes& pack = p.streams[rung_path(0, r)];
    for (const std::uint16_t f : p.tables.planes[0].order)
      pack.insert(pack.end(), rung.data.begin() + static_cast<std::ptrdiff_t>(rung.offset[f]),
                  rung.data.begin() + static_cast<std::ptrdiff_t>(rung.offset[f + 1u]));
  }
  TextureInfo t;
  t.role = "base-colour", t.name = "ball.jpg", t.colour_space = "srgb";
  t.width_px = 64, t.height_px = 48, t.fragment_width_px = t.fragment_height_px = 32, t.columns = t.rows = 2;
  t.grid_reason = plane.grid_reason;
  t.preview_width_px = preview.width_px, t.preview_height_px = preview.height_px;
  t.rung_quality = {20, 70};
  p.textures = {t};
}

void add_scale(PackageParts& p, int scale, const Mesh& mesh) {
  GlbParts glb = make_glb(mesh, p.streams[preview_path(0)]);
  if (scale == 0) name_previews(glb);  // the coarsest scale alone has them
  p.meshes[scale] = glb.glb();
  ManifestScale s;
  s.scale = scale;
  s.triangles = static_cast<std::uint32_t>(mesh.triangles.size());
  s.vertices = static_cast<std::uint32_t>(mesh.wedge_count());
  s.glb.path = mesh_path(scale);
  s.major = true;
  if (scale > 0) s.error_max = 0.125, s.error_rms = 0.0625, s.p95 = 0.05, s.p99 = 0.07;
  s.display_px_jnd = scale ? 300 : kAnyDisplayPx;
  s.display_px_error = scale ? 200 : kAnyDisplayPx;
  s.display_px_edge = scale ? 100 : kAnyDisplayPx;
  s.display_px_flip = scale ? 200 : kAnyDisplayPx;
  p.manifest.scales.push_back(s);
}

}  // namespace

Bytes GlbParts::glb() const {
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  Bytes padded = binary;
  padded.resize((padded.size() + 3) / 4 * 4);
  Bytes out;
  for (const std::uint32_t v : {0x46546c67u, 2u, static_cast<std::uint32_t>(28 + text.size() + padded.size()),
                                static_cast<std::uint32_t>(text.size()), 0x4e4f534au})
    put_u32(out, v);
  out.insert(out.end(), text.begin(), text.end());
  put_u32(out, static_cast<std::uint32_t>(padded.size()));
  put_u32(out, 0x004e4942u);
  out.insert(out.end(), padded.begin(), padded.end());
  return out;
}

GlbParts make_glb(const Mesh& mesh, const Bytes& jpeg) {
  GlbParts g;
  std::vector<Vec3f> positions;
  for (const std::uint32_t p : mesh.wedge_position) positions.push_back(mesh.positions[p]);
  Vec3f lo = positions.front(), hi = lo;
  for (const Vec3f& p : positions)
    for (int k = 0; k < 3; ++k) lo[k] = std::min(lo[k], p[k]), hi[k] = std::max(hi[k], p[k]);
  const std::size_t position = add_accessor(g, add_view(g, positions), 5126, "VEC3", positions.size());
  g.json["accessors"][position]["min"] = {lo.x, lo.y, lo.z};
  g.json["accessors"][position]["max"] = {hi.x, hi.y, hi.z};
  const std::size_t uv = add_accessor(g, add_view(g, mesh.uv0), 5126, "VEC2", mesh.uv0.size());
  const std::size_t indices =
      add_accessor(g, add_view(g, mesh.triangles), 5125, "SCALAR", mesh.triangles.size() * 3);
  json primitive{
      {"attributes", {{"POSITION", position}, {"TEXCOORD_0", uv}}}, {"indices", indices}, {"material", 0}};
  json material{{"pbrMetallicRoughness", json::object()}};
  if (!jpeg.empty()) {
    g.json["images"] = {
        {{"name", "texture/0"}, {"mimeType", "image/jpeg"}, {"bufferView", add_view(g, jpeg)}}};
    g.json["textures"] = {{{"source", 0}}};
    material["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
  }
  g.json["asset"] = {{"version", "2.0"}};
  g.json["materials"] = {material};
  g.json["meshes"] = {{{"primitives", {primitive}}}};
  g.json["nodes"] = {{{"mesh", 0}}};
  g.json["scenes"] = {{{"nodes", {0}}}};
  g.json["scene"] = 0;
  g.json["buffers"] = {{{"byteLength", g.binary.size()}}};
  return g;
}

void name_previews(GlbParts& g) {
  for (json& image : g.json["images"]) {
    image.erase("bufferView");
    image["uri"] = "../" + preview_path(0);
  }
}

Mesh fine_mesh() { return sphere(6, 8); }

Mesh coarse_mesh() {
  Mesh mesh = fine_mesh();
  mesh.triangles.resize(mesh.triangles.size() / 2);
  return mesh;
}

PackageParts make_package_parts() {
  PackageParts p;
  add_texture(p);
  add_scale(p, 0, fine_mesh());
  add_scale(p, 5, coarse_mesh());
  p.manifest.title = "Two spheres";
  p.manifest.origin = {10, 20, 30};
  p.manifest.bounds_min = {-1, -1, -1};
  p.manifest.bounds_max = {1, 1, 1};
  p.manifest.object_height = 2;
  p.manifest.steps = {{200, 5}, {kAnyDisplayPx, 0}};
  p.manifest.plane_count = 1;
  const PictureLosses scales{{0, 0.1f}, {0, 0.2f}, {0, 0.05f}};
  const TextureLosses colours{{0.125f, 0.5f},
                              {{0.05f, 0.2f}, {0.1f, 0.4f}, {0.02f, 0.1f}},
                              {{0.2f}, {0.4f}, {0.1f}},
                              {{0.04f, 0}, {0.08f, 0}, {0.02f, 0}},
                              {{0.1f}, {0.2f}, {0.05f}}};
  p.quality = {2, {256}, {0, 5}, {scales}, {{PlaneGroup::kColour, {colours}}}, 1, 0};
  p.provenance = make_provenance();
  return p;
}

void add_proxies(PackageParts& p) {
  p.manifest.proxy_sizes_px = {128, 512};
  for (const bool larger : {false, true}) {
    const Mesh mesh = larger ? fine_mesh() : coarse_mesh();
    p.proxies.push_back(make_glb(mesh, p.streams[preview_path(0)]).glb());
    ManifestProxy proxy;
    proxy.triangles = static_cast<std::uint32_t>(mesh.triangles.size());
    proxy.vertices = static_cast<std::uint32_t>(mesh.wedge_count());
    proxy.texture_px = std::max(p.textures[0].preview_width_px, p.textures[0].preview_height_px);
    proxy.flip = larger ? std::vector{0.03, 0.06} : std::vector{0.04, 0.2};
    proxy.flip_p95 = larger ? std::vector{0.1, 0.2} : std::vector{0.1, 0.5};
    p.manifest.proxies.push_back(proxy);
  }
}

Bytes PackageParts::build() const {
  const auto bytes_of = [](const std::string& s) { return Bytes(s.begin(), s.end()); };
  std::vector<PackageEntry> entries;
  entries.push_back({kTablesPath, write_tables(tables)});
  if (!thesis.empty()) entries.push_back({kThesisPath, write_thesis(thesis)});
  entries.push_back({kQualityPath, bytes_of(write_quality(quality))});
  entries.push_back({kProvenancePath, bytes_of(provenance.dump())});
  About said = about;
  said.title = manifest.title;
  entries.push_back({kAboutPath, bytes_of(write_about(said))});
  for (const auto& [scale, glb] : meshes) entries.push_back({mesh_path(scale), glb});
  for (std::size_t k = 0; k < proxies.size(); ++k)
    entries.push_back({proxy_path(static_cast<std::uint32_t>(k)), proxies[k]});
  for (const auto& [path, bytes] : streams) entries.push_back({path, bytes});
  return write_package(manifest, textures, entries);
}

}  // namespace texmesh::testing
