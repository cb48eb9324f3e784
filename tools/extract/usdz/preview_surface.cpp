#include "tools/extract/usdz/preview_surface.h"

namespace texmesh {
namespace {

using Node = CrateWriter::Node;

const MaterialExtension* extension_of(const Material& m, std::string_view name) {
  const auto found = std::ranges::find(m.extensions, name, &MaterialExtension::name);
  return found == m.extensions.end() ? nullptr : &*found;
}

float factor_of(const MaterialExtension& e, std::string_view key, float otherwise) {
  const auto found = std::ranges::find(e.factors, key, &ExtensionFactor::key);
  return found == e.factors.end() || found->values.empty() ? otherwise : found->values.front();
}

TextureRef texture_of(const MaterialExtension& e, std::string_view key) {
  const auto found = std::ranges::find(e.textures, key, &ExtensionTexture::key);
  return found == e.textures.end() ? TextureRef{} : found->texture;
}

const char* wrap_name(Wrap wrap) {
  return wrap == Wrap::kRepeat ? "repeat" : wrap == Wrap::kClamp ? "clamp" : "mirror";
}

/// Values of a texture become value * scale + bias.
struct Reading {
  Vec4f scale{1, 1, 1, 1}, bias{0, 0, 0, 0};
  bool colour = false;
};

class SurfaceWriter {
 public:
  SurfaceWriter(CrateWriter& crate, Node scope, const std::string& name,
                const std::vector<std::string>& paths)
      : crate_(crate), paths_(paths), material_(crate.prim(scope, name, "Material")) {
    surface_ = shader("Surface", "UsdPreviewSurface");
    out_.material = material_;
  }

  PreviewSurface write(const Material& m, bool colours) {
    out_.colours = colours;
    if (m.unlit)
      write_unlit(m);
    else
      write_lit(m);
    write_opacity(m);
    const Node shaded = crate_.attribute(surface_, "outputs:surface", "token");
    crate_.connection(material_, "outputs:surface", "token", shaded);
    return std::move(out_);
  }

 private:
  Node shader(const std::string& name, const char* id) {
    const Node node = crate_.prim(material_, name, "Shader");
    crate_.set(crate_.attribute(node, "info:id", "token", crate_.token(id)), "variability", crate_.uniform());
    return node;
  }

  void input(const char* name, float value) {
    crate_.attribute(surface_, std::string("inputs:") + name, "float", crate_.number(value));
  }
  void input(const char* name, Vec3f value) {
    const std::array v{value.x, value.y, value.z};
    crate_.attribute(surface_, std::string("inputs:") + name, "color3f", crate_.vector(v));
  }
  void connect(const char* name, const char* type, Node output) {
    crate_.connection(surface_, std::string("inputs:") + name, type, output);
  }

  /// A shader that hands on a primvar; its result.
  Node reader(const std::string& primvar, const char* id, const char* type) {
    const auto found = readers_.find(primvar);
    if (found != readers_.end()) return found->second;
    const Node node = shader("Read_" + primvar, id);
    crate_.attribute(node, "inputs:varname", "string", crate_.text(primvar));
    return readers_[primvar] = crate_.attribute(node, "outputs:result", type);
  }

  Node texcoord(const TextureRef& ref) {
    const std::pair key{ref.texcoord, ref.transform};
    const auto found = std::ranges::find(out_.texcoords, key);
    const auto k = static_cast<std::size_t>(found - out_.texcoords.begin());
    if (found == out_.texcoords.end()) out_.texcoords.push_back(key);
    return reader(texcoord_name(k), "UsdPrimvarReader_float2", "float2");
  }

  Node texture(const TextureRef& ref, const Reading& reading, const char* use) {
    const Node st = texcoord(ref);
    const Node node = shader(use, "UsdUVTexture");
    crate_.attribute(node, "inputs:file", "asset",
                     crate_.asset(paths_.at(static_cast<std::size_t>(ref.image))));
    crate_.connection(node, "inputs:st", "float2", st);
    crate_.attribute(node, "inputs:wrapS", "token", crate_.token(wrap_name(ref.wrap_s)));
    crate_.attribute(node, "inputs:wrapT", "token", crate_.token(wrap_name(ref.wrap_t)));
    crate_.attribute(node, "inputs:sourceColorSpace", "token", crate_.token(reading.colour ? "sRGB" : "raw"));
    const auto vector = [&](const char* name, Vec4f v, Vec4f usual) {
      if (v != usual) crate_.attribute(node, name, "float4", crate_.vector(std::array{v.x, v.y, v.z, v.w}));
    };
    vector("inputs:scale", reading.scale, {1, 1, 1, 1});
    vector("inputs:bias", reading.bias, {0, 0, 0, 0});
    return node;
  }
  Node output(Node texture, const char* channels) {
    return crate_.attribute(texture, std::string("outputs:") + channels, channels[1] ? "float3" : "float");
  }

  /// The base colour, lit or not.
  void write_base(const Material& m, const char* name) {
    const Vec4f b = m.base_colour;
    if (m.base_colour_texture.used()) {
      base_ = texture(m.base_colour_texture, {b, {0, 0, 0, 0}, true}, "BaseColour");
      connect(name, "color3f", output(*base_, "rgb"));
    } else if (out_.colours) {
      connect(name, "color3f", reader("displayColor", "UsdPrimvarReader_float3", "float3"));
    } else {
      input(name, Vec3f{b.x, b.y, b.z});
    }
  }

  void write_opacity(const Material& m) {
    if (m.alpha_mode == AlphaMode::kOpaque) return;
    if (base_)
      connect("opacity", "float", output(*base_, "a"));
    else
      input("opacity", m.base_colour.w);
    if (m.alpha_mode == AlphaMode::kMask) input("opacityThreshold", m.alpha_cutoff);
  }

  /// Light of its own, and none that it reflects.
  void write_unlit(const Material& m) {
    write_base(m, "emissiveColor");
    input("diffuseColor", Vec3f{0, 0, 0});
    input("specularColor", Vec3f{0, 0, 0});
    crate_.attribute(surface_, "inputs:useSpecularWorkflow", "int", crate_.integer(1));
    input("roughness", 1);
  }

  void write_lit(const Material& m) {
    write_base(m, "diffuseColor");
    write_metal(m);
    if (m.normal_texture.used()) {
      const float s = m.normal_scale;
      const Reading r{{2 * s, 2 * s, 2, 1}, {-s, -s, -1, 0}};
      connect("normal", "normal3f", output(texture(m.normal_texture, r, "Normal"), "rgb"));
    }
    if (m.occlusion_texture.used()) {
      const float s = m.occlusion_strength;
      const Reading r{{s, s, s, 1}, {1 - s, 1 - s, 1 - s, 0}};
      connect("occlusion", "float", output(texture(m.occlusion_texture, r, "Occlusion"), "r"));
    }
    write_emission(m);
    if (const MaterialExtension* e = extension_of(m, "KHR_materials_ior"))
      input("ior", factor_of(*e, "ior", 1.5f));
    if (const MaterialExtension* e = extension_of(m, "KHR_materials_clearcoat")) write_clearcoat(*e);
  }

  /// A factor of 0 leaves nothing of the texture; some readers do not know scales.
  void write_metal(const Material& m) {
    std::optional<Node> node;
    const auto one = [&](const char* name, float factor, const char* channel) {
      if (!m.metallic_roughness_texture.used() || factor == 0) return input(name, factor);
      if (!node)
        node = texture(m.metallic_roughness_texture, {{1, m.roughness, m.metallic, 1}}, "MetallicRoughness");
      connect(name, "float", output(*node, channel));
    };
    one("metallic", m.metallic, "b");
    one("roughness", m.roughness, "g");
  }

  void write_emission(const Material& m) {
    const MaterialExtension* e = extension_of(m, "KHR_materials_emissive_strength");
    const float strength = e ? factor_of(*e, "emissiveStrength", 1) : 1;
    const Vec3f light{m.emissive.x * strength, m.emissive.y * strength, m.emissive.z * strength};
    if (light == Vec3f{0, 0, 0}) return;
    if (m.emissive_texture.used())
      connect("emissiveColor", "color3f",
              output(texture(m.emissive_texture, {{light.x, light.y, light.z, 1}, {0, 0, 0, 0}, true},
                             "Emission"),
                     "rgb"));
    else
      input("emissiveColor", light);
  }

  void write_clearcoat(const MaterialExtension& e) {
    const auto one = [&](const char* name, const char* factor, const char* key, const char* channel,
                         const char* use) {
      const float f = factor_of(e, factor, 0);
      const TextureRef ref = texture_of(e, key);
      if (ref.used())
        connect(name, "float", output(texture(ref, {{f, f, f, 1}}, use), channel));
      else
        input(name, f);
    };
    one("clearcoat", "clearcoatFactor", "clearcoatTexture", "r", "Clearcoat");
    one("clearcoatRoughness", "clearcoatRoughnessFactor", "clearcoatRoughnessTexture", "g",
        "ClearcoatRoughness");
  }

  CrateWriter& crate_;
  const std::vector<std::string>& paths_;
  Node material_ = 0, surface_ = 0;
  std::map<std::string, Node> readers_;
  std::optional<Node> base_;
  PreviewSurface out_;
};

}  // namespace

std::string texcoord_name(std::size_t k) { return k == 0 ? "st" : "st" + std::to_string(k); }

std::string unsaid_by_preview_surface(const Material& material) {
  constexpr std::string_view kSaid[] = {"KHR_materials_clearcoat", "KHR_materials_emissive_strength",
                                        "KHR_materials_ior"};
  for (const MaterialExtension& e : material.extensions) {
    if (std::ranges::find(kSaid, e.name) == std::end(kSaid)) return e.name;
    if (texture_of(e, "clearcoatNormalTexture").used()) return "a normal map of a clearcoat";
  }
  return "";
}

PreviewSurface add_preview_surface(CrateWriter& crate, CrateWriter::Node scope, const std::string& name,
                                   const Material& material, bool colours,
                                   const std::vector<std::string>& paths) {
  return SurfaceWriter(crate, scope, name, paths).write(material, colours);
}

}  // namespace texmesh
