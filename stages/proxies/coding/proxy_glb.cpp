#include "stages/proxies/coding/proxy_glb.h"

#include <meshoptimizer.h>

#include "format/base/numbering.h"
#include "format/base/portable_math.h"
#include "stages/gltf/glb_writer.h"
#include "stages/image/resize.h"
#include "stages/image/webp.h"
#include "stages/render/shade.h"

namespace texmesh {
namespace {

using Json = GlbWriter::Json;
constexpr int kByte = 5120, kUnsignedShort = 5123, kUnsignedInt = 5125, kFloat = 5126;
constexpr int kLinear = 9729, kLinearMipmapLinear = 9987, kClampToEdge = 33071;

class ProxyWriter {
 public:
  Bytes write(const CodedMesh& mesh, const std::vector<MaterialGroup>& groups,
              const ProxyPictures& pictures) {
    uv_step_ = mesh.uv_step;
    Json primitives = Json::array();
    for (const CodedGroup& g : mesh.groups) {
      primitives.push_back(g.is_draco() ? draco_primitive(g, mesh) : primitive(g));
      primitives.back()["material"] = writer_.array("materials").size();
      writer_.array("materials").push_back(material(groups.at(g.group), pictures));
    }
    writer_.array("meshes").push_back({{"primitives", std::move(primitives)}});
    Json node{{"mesh", 0}};
    if (is_quantised()) {
      writer_.use_extension("KHR_mesh_quantization", true);
      writer_.use_extension("KHR_texture_transform", true);
      node["translation"] = GlbWriter::shortest(mesh.origin);
      node["scale"] = GlbWriter::shortest({mesh.step, mesh.step, mesh.step});
    }
    writer_.array("nodes").push_back(std::move(node));
    return writer_.finish();
  }

 private:
  /// Whether positions and coordinates are places of grids, which node and textures scale.
  bool is_quantised() const { return writer_.uses_meshopt(); }

  std::size_t view(const MeshStream& s, bool is_index) {
    return writer_.add_meshopt_view(s.packed, s.count, s.stride, is_index);
  }
  Json primitive(const CodedGroup& g) {
    constexpr std::size_t kUvOffset = 8, kNormalOffset = 12;
    const std::size_t vertices = view(g.vertex_stream, false), n = g.vertices();
    Json attributes;
    attributes["POSITION"] = writer_.add_accessor({{"bufferView", vertices},
                                                   {"componentType", kUnsignedShort},
                                                   {"count", n},
                                                   {"type", "VEC3"},
                                                   {"min", g.least},
                                                   {"max", g.most}});
    if (g.has_normals)
      attributes["NORMAL"] = writer_.add_accessor({{"bufferView", vertices},
                                                   {"byteOffset", kNormalOffset},
                                                   {"componentType", kByte},
                                                   {"normalized", true},
                                                   {"count", n},
                                                   {"type", "VEC3"}});
    attributes["TEXCOORD_0"] = writer_.add_accessor({{"bufferView", vertices},
                                                     {"byteOffset", kUvOffset},
                                                     {"componentType", kUnsignedShort},
                                                     {"count", n},
                                                     {"type", "VEC2"}});
    Json indices{{"bufferView", view(g.indices, true)},
                 {"componentType", g.indices.stride == 2 ? kUnsignedShort : kUnsignedInt},
                 {"count", g.indices.count},
                 {"type", "SCALAR"}};
    return {{"attributes", std::move(attributes)}, {"indices", writer_.add_accessor(std::move(indices))}};
  }

  Json draco_primitive(const CodedGroup& g, const CodedMesh& mesh) {
    const auto place = [&](const std::array<std::uint32_t, 3>& at) {
      const Vec3f p{static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])};
      return GlbWriter::shortest(mesh.origin + p * mesh.step);
    };
    const auto floats = [](const char* type) {
      return Json{{"componentType", kFloat}, {"count", 0}, {"type", type}};
    };
    std::vector<GlbWriter::DracoAccessor> attributes{{"POSITION", floats("VEC3")}};
    attributes[0].accessor["min"] = place(g.least);
    attributes[0].accessor["max"] = place(g.most);
    if (g.has_normals) attributes.push_back({"NORMAL", floats("VEC3")});
    attributes.push_back({"TEXCOORD_0", floats("VEC2")});
    return writer_.add_draco(g.draco, std::move(attributes));
  }

  /// Of one picture the same texture for all materials.
  Json texture_info(const ProxyImage& image, std::size_t slot, bool mip_levels) {
    if (!texture_[slot]) {
      Json& samplers = writer_.array("samplers");
      if (samplers.empty())
        samplers.push_back({{"magFilter", kLinear},
                            {"minFilter", mip_levels ? kLinearMipmapLinear : kLinear},
                            {"wrapS", kClampToEdge},
                            {"wrapT", kClampToEdge}});
      Json texture{{"sampler", 0}};
      const std::size_t source = writer_.array("images").size();
      texture["extensions"]["EXT_texture_webp"]["source"] = source;
      writer_.use_extension("EXT_texture_webp", true);
      writer_.array("images").push_back(
          {{"bufferView", writer_.add_view(image.file)}, {"mimeType", "image/webp"}});
      texture_[slot] = writer_.array("textures").size();
      writer_.array("textures").push_back(std::move(texture));
    }
    Json out{{"index", *texture_[slot]}};
    if (is_quantised())
      out["extensions"]["KHR_texture_transform"] = {{"scale", GlbWriter::shortest({uv_step_.x, uv_step_.y})}};
    return out;
  }

  Json material(const MaterialGroup& group, const ProxyPictures& pictures) {
    const auto texture = [&](const ProxyImage& image, std::size_t slot) {
      return texture_info(image, slot, pictures.mip_levels);
    };
    Json pbr{{"baseColorTexture", texture(pictures.base_colour, 0)}};
    Json out;
    if (!group.unlit) {
      if (pictures.orm) {
        pbr["metallicRoughnessTexture"] = texture(*pictures.orm, 1);
        out["occlusionTexture"] = texture(*pictures.orm, 1);
      } else {
        pbr["metallicFactor"] = GlbWriter::shortest(pictures.metallic);
        pbr["roughnessFactor"] = GlbWriter::shortest(pictures.roughness);
      }
      if (pictures.normal) out["normalTexture"] = texture(*pictures.normal, 2);
      if (pictures.emission) {
        out["emissiveTexture"] = texture(*pictures.emission, 3);
        out["emissiveFactor"] = GlbWriter::shortest(pictures.emissive);
      }
    } else {
      pbr["metallicFactor"] = 0;
      out["extensions"]["KHR_materials_unlit"] = Json::object();
      writer_.use_extension("KHR_materials_unlit", false);
    }
    out["pbrMetallicRoughness"] = std::move(pbr);
    if (group.alpha_mode != AlphaMode::kOpaque)
      out["alphaMode"] = group.alpha_mode == AlphaMode::kMask ? "MASK" : "BLEND";
    if (group.double_sided) out["doubleSided"] = true;
    return out;
  }

  GlbWriter writer_;
  Vec2f uv_step_;
  std::array<std::optional<std::size_t>, 4> texture_;
};

constexpr float kOcclusionInColour = 0.5f;
constexpr int kLeastQuality = 1, kMostQuality = 95;
constexpr double kFull =
    -0.025;  // log of the share of the bytes: more is not worth another run of the encoder
// Normals and plain numbers need finer steps than colours for the same look.
constexpr int kNormalQualityAbove = 10, kOrmQualityBelow = 5;

std::uint8_t byte_of(float x) {
  return static_cast<std::uint8_t>(std::floor(std::clamp(x, 0.0f, 1.0f) * 255 + 0.5f));
}

Pixels srgb_pixels(const std::vector<Vec3f>& linear, std::uint32_t width_px, std::uint32_t height_px) {
  Pixels out = encode_srgb(Picture{width_px, linear, {}});
  out.width_px = width_px, out.height_px = height_px;
  return out;
}

Pixels plain_pixels(const std::vector<Vec3f>& values, std::uint32_t width_px, std::uint32_t height_px,
                    bool is_signed) {
  Pixels out{width_px, height_px, 3, {}};
  for (const Vec3f v : values)
    for (int k = 0; k < 3; ++k) out.data.push_back(byte_of(is_signed ? v[k] * 0.5f + 0.5f : v[k]));
  return out;
}

Bytes coded_picture(const Pixels& pixels, int quality) {
  WebpOptions options;
  options.quality = static_cast<float>(quality);
  options.alpha_quality = quality;
  return encode_webp(pixels, options);
}

enum MapKind : std::size_t { kBaseColour, kOrm, kNormal, kEmission };

ProxyPictures code_at(const MapPixels& maps, int quality, CodedPictures& coded) {
  const auto code = [&](MapKind kind, const Pixels& pixels, int its_quality) {
    its_quality = std::clamp(its_quality, 0, 100);
    const auto [at, is_new] = coded.images[kind].try_emplace(its_quality);
    if (is_new) at->second = {coded_picture(pixels, its_quality), pixels.width_px, pixels.height_px};
    return at->second;
  };
  ProxyPictures out;
  out.metallic = maps.metallic, out.roughness = maps.roughness, out.emissive = maps.emissive;
  out.quality = quality;
  out.base_colour = code(kBaseColour, maps.base_colour, quality);
  if (maps.choice.orm) out.orm = code(kOrm, maps.orm, quality - kOrmQualityBelow);
  if (maps.choice.normal) out.normal = code(kNormal, maps.normal, quality + kNormalQualityAbove);
  if (!maps.emission.data.empty()) out.emission = code(kEmission, maps.emission, quality);
  return out;
}

/// How fine libwebp's steps are at a quality, 0..1; logarithms of bytes grow evenly with it, while they grow
/// three times as fast with qualities above 75 as with those below.
double fineness_of(int quality) {
  const double q = std::max(quality, 1) / 100.0, share = q < 0.75 ? q * 2 / 3 : 2 * q - 1;
  return portable::exp(portable::log(share) / 3);
}
double quality_of(double fineness) {
  const double share = fineness * fineness * fineness;
  return 100 * (share < 0.5 ? share * 1.5 : (share + 1) / 2);
}

struct PositionGrid {
  Vec3f origin;
  float step = 1;
  std::uint32_t last = 0;
  std::uint32_t place(float x, int axis) const {
    const double at = std::floor(
        (static_cast<double>(x) - static_cast<double>(origin[axis])) / static_cast<double>(step) + 0.5);
    return static_cast<std::uint32_t>(std::clamp(at, 0.0, static_cast<double>(last)));
  }
  std::array<std::uint32_t, 3> places(Vec3f p) const { return {place(p.x, 0), place(p.y, 1), place(p.z, 2)}; }
};

PositionGrid make_position_grid(const AtlasMesh& mesh, int bits) {
  Box3f box;
  for (const Vec3f p : mesh.positions) box.extend(p);
  PositionGrid grid;
  grid.last = (std::uint32_t{1} << bits) - 1;
  if (mesh.positions.empty()) return grid;
  grid.origin = box.min;
  const Vec3f size = box.max - box.min;
  const float longest = std::max({size.x, size.y, size.z});
  if (longest > 0) grid.step = longest / static_cast<float>(grid.last);
  return grid;
}

// Coordinates need not be finer than this part of a texel.
constexpr std::uint32_t kStepsPerTexel = 4;

/// Places from 0 to 1 along both axes.
struct UvGrid {
  std::array<std::uint32_t, 2> last{};
  std::uint32_t place(float x, std::size_t axis) const {
    return static_cast<std::uint32_t>(
        std::floor(std::clamp(x, 0.0f, 1.0f) * static_cast<float>(last[axis]) + 0.5f));
  }
  Vec2f step() const { return {1 / static_cast<float>(last[0]), 1 / static_cast<float>(last[1])}; }
};

int uv_bits(const AtlasMesh& mesh) {
  int bits = 6;
  while (bits < 16 && (std::uint32_t{1} << bits) < kStepsPerTexel * std::max(mesh.width_px, mesh.height_px))
    ++bits;
  return bits;
}

UvGrid make_uv_grid(const AtlasMesh& mesh, bool draco) {
  if (draco) {
    const std::uint32_t last = (std::uint32_t{1} << uv_bits(mesh)) - 1;
    return {{last, last}};
  }
  const auto steps = [](std::uint32_t texels) { return std::clamp(kStepsPerTexel * texels, 1u, 65535u); };
  return {{steps(mesh.width_px), steps(mesh.height_px)}};
}

std::uint8_t signed8(float x) {
  return static_cast<std::uint8_t>(static_cast<int>(std::floor(std::clamp(x, -1.0f, 1.0f) * 127 + 0.5f)));
}

/// Vertices and triangles of one group, in the order of first use by cache-friendly strips.
struct GroupMesh {
  std::vector<std::uint32_t> vertices;  // of the atlas mesh
  std::vector<std::uint32_t> indices;   // of `vertices`
};

GroupMesh group_mesh(const AtlasMesh& mesh, std::uint32_t group, const PositionGrid& grid) {
  GroupMesh out;
  std::vector<std::uint32_t> index(mesh.positions.size(), kNoIndex);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& corner = mesh.triangles[t];
    if (mesh.group_of[t] != group) continue;
    std::array<std::array<std::uint32_t, 3>, 3> at;
    for (std::size_t k = 0; k < 3; ++k) at[k] = grid.places(mesh.positions[corner[k]]);
    if (at[0] == at[1] || at[1] == at[2] || at[2] == at[0]) continue;
    for (const std::uint32_t v : corner) out.indices.push_back(numbered(index[v], out.vertices, v));
  }
  if (out.indices.empty()) return out;
  std::vector<std::uint32_t> ordered(out.indices.size()), remap(out.vertices.size());
  meshopt_optimizeVertexCacheStrip(ordered.data(), out.indices.data(), ordered.size(), out.vertices.size());
  meshopt_optimizeVertexFetchRemap(remap.data(), ordered.data(), ordered.size(), out.vertices.size());
  std::vector<std::uint32_t> vertices(out.vertices.size());
  for (std::size_t i = 0; i < remap.size(); ++i) vertices[remap[i]] = out.vertices[i];
  for (std::uint32_t& i : ordered) i = remap[i];
  return {std::move(vertices), std::move(ordered)};
}

MeshStream index_stream(const GroupMesh& group) {
  MeshStream out{{}, group.vertices.size() > 65535 ? 4u : 2u, group.indices.size()};
  out.packed = meshopt_triangles(group.indices, group.vertices.size(), "proxies");
  return out;
}

Vec3f position_at(const PositionGrid& grid, const std::array<std::uint32_t, 3>& at) {
  const Vec3f place{static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])};
  return grid.origin + place * grid.step;
}

void extend(CodedGroup& group, const std::array<std::uint32_t, 3>& at) {
  for (std::size_t k = 0; k < 3; ++k) {
    group.least[k] = std::min(group.least[k], at[k]);
    group.most[k] = std::max(group.most[k], at[k]);
  }
}

/// All that the groups of a mesh share.
class GroupCoder {
 public:
  GroupCoder(const AtlasMesh& mesh, const MeshCoding& coding)
      : mesh_(mesh),
        coding_(coding),
        grid_(make_position_grid(mesh, coding.position_bits)),
        uv_grid_(make_uv_grid(mesh, coding.draco)) {}

  const PositionGrid& grid() const { return grid_; }
  const UvGrid& uv_grid() const { return uv_grid_; }
  CodedGroup code(const GroupMesh& group, const std::vector<Vec3f>& normals) const {
    CodedGroup out;
    out.least.fill(grid_.last);
    if (coding_.draco)
      code_draco(group, normals, out);
    else
      code_meshopt(group, normals, out);
    return out;
  }

 private:
  void code_meshopt(const GroupMesh& group, const std::vector<Vec3f>& normals, CodedGroup& out) const {
    out.has_normals = !normals.empty();
    std::vector<std::uint8_t> raw;
    const auto put16 = [&](std::uint32_t x) {
      raw.push_back(static_cast<std::uint8_t>(x));
      raw.push_back(static_cast<std::uint8_t>(x >> 8));
    };
    for (const std::uint32_t v : group.vertices) {
      const std::array<std::uint32_t, 3> at = grid_.places(mesh_.positions[v]);
      extend(out, at);
      for (const std::uint32_t x : {at[0], at[1], at[2], 0u}) put16(x);
      put16(uv_grid_.place(mesh_.uvs[v].x, 0));
      put16(uv_grid_.place(mesh_.uvs[v].y, 1));
      if (!out.has_normals) continue;
      const Vec3f n = normals[v];
      raw.insert(raw.end(), {signed8(n.x), signed8(n.y), signed8(n.z), 0});
    }
    out.vertex_stream = {{}, out.has_normals ? 16u : 12u, group.vertices.size()};
    out.vertex_stream.packed =
        meshopt_attributes(raw, out.vertex_stream.count, out.vertex_stream.stride, "proxies");
    out.indices = index_stream(group);
  }

  void code_draco(const GroupMesh& group, const std::vector<Vec3f>& normals, CodedGroup& out) const {
    constexpr int kSpeed = 3;  // slower ones gain less than 1 % on small meshes
    constexpr int kNormalBits = 8;
    DracoMesh mesh(group.indices, group.vertices.size());
    mesh.add("POSITION", {coding_.position_bits, grid_.origin, grid_.step * static_cast<float>(grid_.last)},
             [&](std::uint32_t i) {
               const std::array<std::uint32_t, 3> at = grid_.places(mesh_.positions[group.vertices[i]]);
               extend(out, at);
               return position_at(grid_, at);
             });
    out.has_normals = !normals.empty();
    if (out.has_normals)
      mesh.add("NORMAL", {kNormalBits, {}, 1}, [&](std::uint32_t i) { return normals[group.vertices[i]]; });
    mesh.add("TEXCOORD_0", {uv_bits(mesh_), {}, 1},
             [&](std::uint32_t i) { return mesh_.uvs[group.vertices[i]]; });
    try {
      out.draco = mesh.encode(kSpeed);
    } catch (const StageError&) {  // what Draco refuses is left to meshopt
    }
  }

  const AtlasMesh& mesh_;
  const MeshCoding& coding_;
  PositionGrid grid_;
  UvGrid uv_grid_;
};

}  // namespace

std::size_t ProxyPictures::bytes() const {
  std::size_t sum = base_colour.file.size();
  for (const auto* image : {&orm, &normal, &emission})
    if (*image) sum += (*image)->file.size();
  return sum;
}

Bytes proxy_glb(const CodedMesh& mesh, const std::vector<MaterialGroup>& groups,
                const ProxyPictures& pictures) {
  return ProxyWriter().write(mesh, groups, pictures);
}

MapPixels map_pixels(const BakedMaps& maps, const MapChoice& choice) {
  MapPixels out;
  out.choice = choice;
  // A map of one value says no more than a factor.
  constexpr float kSame = 1.5f / 255;
  bool varies = false;
  for (int k = 0; k < 3; ++k) varies = varies || maps.most_orm[k] - maps.least_orm[k] > kSame;
  out.choice.orm = choice.orm && (varies || maps.mean_orm.x < 1 - kSame);
  const std::uint32_t w = maps.width_px, h = maps.height_px;
  std::vector<Vec3f> base = maps.base_colour;
  if (!out.choice.orm)
    for (std::size_t i = 0; i < base.size(); ++i)
      base[i] = base[i] * (1 - kOcclusionInColour * (1 - maps.occlusion_roughness_metallic[i].x));
  out.base_colour = srgb_pixels(base, w, h);
  if (maps.has_alpha) {
    Pixels alpha{w, h, 1, {}};
    for (const float a : maps.alpha) alpha.data.push_back(byte_of(a));
    out.base_colour = joined_alpha(out.base_colour, alpha);
  }
  out.roughness = maps.mean_orm.y, out.metallic = maps.mean_orm.z;
  if (out.choice.orm) out.orm = plain_pixels(maps.occlusion_roughness_metallic, w, h, false);
  if (choice.normal) out.normal = plain_pixels(maps.normal, w, h, true);
  if (!maps.has_emission) return out;
  std::vector<Vec3f> emission = maps.emission;
  for (int k = 0; k < 3; ++k) {
    const float most = std::min(maps.most_emission[k], 1.0f);
    out.emissive[k] = most;
    for (Vec3f& e : emission) e[k] = most > 0 ? e[k] / most : 0;
  }
  out.emission = srgb_pixels(emission, w, h);
  return out;
}

ProxyPictures code_pictures(const MapPixels& maps, std::size_t max_bytes, CodedPictures& coded) {
  constexpr int kFirstGuess = 60, kTries = kMostQuality;
  // Finenesses for e times the bytes.
  constexpr double kFirstSlope = 0.3, kLeastSlope = 0.1, kMostSlope = 1;
  double slope = kFirstSlope, last_fill = 0;
  int last_quality = 0;
  const auto fill_of = [&](int quality) {
    return portable::log(static_cast<double>(code_at(maps, quality, coded).bytes()) /
                         static_cast<double>(std::max<std::size_t>(max_bytes, 1)));
  };
  const auto nearer = [&](int quality, double fill) {
    const double fineness = fineness_of(quality);
    if (last_quality > 0 && fill != last_fill)
      slope =
          std::clamp((fineness - fineness_of(last_quality)) / (fill - last_fill), kLeastSlope, kMostSlope);
    last_quality = quality, last_fill = fill;
    // The aim is the middle of what is full enough.
    return quality_of(std::clamp(fineness + (kFull / 2 - fill) * slope, 0.0, 1.0));
  };
  coded.last_quality =
      fullest(kLeastQuality, kMostQuality, coded.last_quality > 0 ? coded.last_quality : kFirstGuess, kTries,
              kFull, fill_of, nearer)
          .value_or(kLeastQuality);
  return code_at(maps, coded.last_quality, coded);
}

std::size_t CodedMesh::bytes() const {
  std::size_t sum = 0;
  for (const CodedGroup& g : groups)
    sum += g.draco.bytes.size() + g.vertex_stream.packed.size() + g.indices.packed.size();
  return sum;
}

CodedMesh code_mesh(const AtlasMesh& mesh, const std::vector<Vec3f>& normals,
                    const std::vector<bool>& with_normals, const MeshCoding& coding) {
  const GroupCoder coder(mesh, coding);
  CodedMesh out{coder.grid().origin, coder.grid().step, coder.uv_grid().step(), {}};
  const std::vector<Vec3f> none;
  for (std::uint32_t g = 0; g < with_normals.size(); ++g) {
    const GroupMesh group = group_mesh(mesh, g, coder.grid());
    if (group.indices.empty()) continue;
    out.groups.push_back(coder.code(group, with_normals[g] ? normals : none));
    out.groups.back().group = g;
    // Draco's positions and meshopt's places cannot share a node.
    if (coding.draco && !out.groups.back().is_draco())
      return code_mesh(mesh, normals, with_normals, {false, coding.position_bits});
  }
  return out;
}

RoundedMesh rounded_mesh(const AtlasMesh& mesh, const std::vector<Vec3f>& normals, const MeshCoding& coding) {
  const GroupCoder coder(mesh, coding);
  RoundedMesh out;
  for (const Vec3f p : mesh.positions)
    out.positions.push_back(position_at(coder.grid(), coder.grid().places(p)));
  const auto component = [](float x) { return static_cast<float>(static_cast<std::int8_t>(signed8(x))); };
  for (const Vec3f n : normals)
    out.normals.push_back(normalized(Vec3f{component(n.x), component(n.y), component(n.z)}));
  const Vec2f step = coder.uv_grid().step();
  for (const Vec2f uv : mesh.uvs)
    out.uvs.push_back({static_cast<float>(coder.uv_grid().place(uv.x, 0)) * step.x,
                       static_cast<float>(coder.uv_grid().place(uv.y, 1)) * step.y});
  return out;
}

}  // namespace texmesh
