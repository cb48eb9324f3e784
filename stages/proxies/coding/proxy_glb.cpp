#include "stages/proxies/coding/proxy_glb.h"

#include "stages/gltf/glb_writer.h"

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

}  // namespace texmesh
