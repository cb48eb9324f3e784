#include "stages/proxies/coding/proxy_glb.h"

#include <array>
#include <nlohmann/json.hpp>

#include "stages/gltf/glb_writer.h"

namespace texmesh::proxies {
namespace {

using Json = GlbWriter::Json;
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;
constexpr int kByte = 5120, kUnsignedShort = 5123, kUnsignedInt = 5125;

class ProxyWriter {
 public:
  Bytes write(const CodedMesh& mesh, const std::vector<MaterialGroup>& groups,
              const ProxyPictures& pictures) {
    writer_.use_extension("EXT_meshopt_compression", true);
    writer_.use_extension("KHR_mesh_quantization", true);
    Json primitives = Json::array();
    for (const CodedGroup& g : mesh.groups) {
      primitives.push_back(primitive(g));
      primitives.back()["material"] = writer_.array("materials").size();
      writer_.array("materials").push_back(material(groups.at(g.group), pictures));
    }
    writer_.array("meshes").push_back({{"primitives", std::move(primitives)}});
    Json node{{"mesh", 0}};
    node["translation"] = numbers({mesh.origin.x, mesh.origin.y, mesh.origin.z});
    node["scale"] = numbers({mesh.step, mesh.step, mesh.step});
    writer_.array("nodes").push_back(std::move(node));
    writer_.set_fallback_buffer(fallback_bytes_);
    return writer_.finish();
  }

 private:
  static Json numbers(std::initializer_list<float> values) {
    Json out = Json::array();
    for (const float x : values) out.push_back(GlbWriter::shortest(x));
    return out;
  }

  std::size_t view(const MeshStream& s, bool is_index) {
    const std::size_t offset = writer_.add_bytes(s.packed);
    Json view{{"buffer", 1}, {"byteOffset", fallback_bytes_}, {"byteLength", s.count * s.stride}};
    if (!is_index) view["byteStride"] = s.stride;
    view["target"] = is_index ? kElementArrayBuffer : kArrayBuffer;
    view["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},
                                                     {"byteOffset", offset},
                                                     {"byteLength", s.packed.size()},
                                                     {"byteStride", s.stride},
                                                     {"count", s.count},
                                                     {"mode", is_index ? "TRIANGLES" : "ATTRIBUTES"}};
    fallback_bytes_ += (s.count * s.stride + 3) / 4 * 4;
    return writer_.add_json_view(std::move(view));
  }
  std::size_t accessor(const MeshStream& s, int type, const char* shape, bool normalized) {
    Json json{{"bufferView", view(s, false)}, {"componentType", type}};
    if (normalized) json["normalized"] = true;
    json["count"] = s.count;
    json["type"] = shape;
    return writer_.add_accessor(std::move(json));
  }
  Json primitive(const CodedGroup& g) {
    Json attributes;
    Json positions{{"bufferView", view(g.positions, false)},
                   {"componentType", kUnsignedShort},
                   {"count", g.positions.count},
                   {"type", "VEC3"},
                   {"min", g.least},
                   {"max", g.most}};
    attributes["POSITION"] = writer_.add_accessor(std::move(positions));
    if (g.normals.count > 0) attributes["NORMAL"] = accessor(g.normals, kByte, "VEC3", true);
    attributes["TEXCOORD_0"] = accessor(g.uvs, kUnsignedShort, "VEC2", true);
    Json indices{{"bufferView", view(g.indices, true)},
                 {"componentType", g.indices.stride == 2 ? kUnsignedShort : kUnsignedInt},
                 {"count", g.indices.count},
                 {"type", "SCALAR"}};
    return {{"attributes", std::move(attributes)}, {"indices", writer_.add_accessor(std::move(indices))}};
  }

  /// Of one picture the same texture for all materials.
  Json texture(const ProxyImage& image, std::size_t slot) {
    if (!texture_[slot]) {
      Json& samplers = writer_.array("samplers");
      if (samplers.empty())
        samplers.push_back({{"magFilter", 9729}, {"minFilter", 9987}, {"wrapS", 33071}, {"wrapT", 33071}});
      Json texture{{"sampler", 0}};
      const std::size_t source = writer_.array("images").size();
      if (image.webp) {
        texture["extensions"]["EXT_texture_webp"]["source"] = source;
        writer_.use_extension("EXT_texture_webp", true);
      } else {
        texture["source"] = source;
      }
      writer_.array("images").push_back({{"bufferView", writer_.add_view(image.file)},
                                         {"mimeType", image.webp ? "image/webp" : "image/jpeg"}});
      texture_[slot] = writer_.array("textures").size();
      writer_.array("textures").push_back(std::move(texture));
    }
    return {{"index", *texture_[slot]}};
  }

  Json material(const MaterialGroup& group, const ProxyPictures& pictures) {
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
        const Vec3f e = pictures.emissive;
        out["emissiveFactor"] = numbers({e.x, e.y, e.z});
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
  std::size_t fallback_bytes_ = 0;
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

}  // namespace texmesh::proxies
