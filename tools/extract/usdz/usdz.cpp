#include "tools/extract/usdz/usdz.h"

#include "format/container/container.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/geometry/texel_coverage.h"
#include "stages/gltf/glb_container.h"
#include "tools/extract/glb/standalone_glb.h"
#include "tools/extract/usdz/crate_writer.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
using Node = CrateWriter::Node;

constexpr double kNewJpegQuality = 90;

[[noreturn]] void refuse(const std::string& entry, const std::string& what) {
  throw InputError(entry, "USDZ", "what UsdPreviewSurface can say",
                   what + "; texmesh extract -o FILE.glb keeps it");
}

/// A material of a layer: a UsdPreviewSurface with its textures.
struct PreviewSurface {
  CrateWriter::Node material = 0;
  /// Texture coordinates that its textures read: the set and its transform; the k-th is the primvar
  /// texcoord_name(k), with v upwards.
  std::vector<std::pair<std::uint8_t, UvTransform>> texcoords;
  bool colours = false;  // it reads displayColor
};

/// "st", "st1", ...
std::string texcoord_name(std::size_t k) { return k == 0 ? "st" : "st" + std::to_string(k); }

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

/// Why a UsdPreviewSurface cannot say a material; "" where it can.
std::string unsaid_by_preview_surface(const Material& material) {
  constexpr std::string_view kSaid[] = {"KHR_materials_clearcoat", "KHR_materials_emissive_strength",
                                        "KHR_materials_ior"};
  for (const MaterialExtension& e : material.extensions) {
    if (std::ranges::find(kSaid, e.name) == std::end(kSaid)) return e.name;
    if (texture_of(e, "clearcoatNormalTexture").used()) return "a normal map of a clearcoat";
  }
  return "";
}

/// The images of a GLB, by number; the GLB has single texels for them, named by number, which import does not
/// take for one.
std::vector<FileImageData> take_images(GlbParts& parts) {
  std::vector<FileImageData> out;
  if (!parts.root.contains("images")) return out;
  for (Json& image : parts.root["images"]) {
    const std::string type = image.value("mimeType", "");
    FileImageData data{FileImage::kJpeg, image_bytes(parts, image)};
    for (const FileImage f : {FileImage::kPng, FileImage::kWebp, FileImage::kAvif})
      if (type == mime_type_of(f)) data.format = f;
    const auto k = static_cast<std::uint32_t>(out.size());
    const auto byte = [k](int shift) { return static_cast<std::uint8_t>(k >> shift); };
    const Json name = image_name(k);
    const std::size_t view =
        add_view(parts, encode_image({1, 1, 3, {byte(0), byte(8), byte(16)}}, {FileImage::kPng}));
    image = {{"name", name}, {"mimeType", "image/png"}, {"bufferView", view}};
    out.push_back(std::move(data));
  }
  if (parts.root.contains("textures"))
    for (Json& texture : parts.root["textures"])
      for (const char* name : {"EXT_texture_webp", "EXT_texture_avif"})
        if (texture.contains("extensions") && texture["extensions"].contains(name)) {
          texture["source"] = texture["extensions"][name].at("source");
          texture.erase("extensions");
        }
  for (const char* name : {"EXT_texture_webp", "EXT_texture_avif"}) forget_extension(parts.root, name);
  parts.root["buffers"][0]["byteLength"] = parts.binary.size();
  return out;
}

std::string note_of_other_images(bool webp) {
  return std::string(webp ? "WebP" : "AVIF") + " images are JPEG or PNG in the USDZ, which has no others";
}

/// The image as JPEG or PNG.
FileImageData readable(FileImageData image, bool numbers, std::vector<std::string>& notes) {
  if (image.format == FileImage::kJpeg || image.format == FileImage::kPng) return image;
  const Pixels pixels = decode_file_image(image);
  const FileImage format = pixels.channels == 4 || pixels.channels == 2 ? FileImage::kPng : FileImage::kJpeg;
  const std::string note = note_of_other_images(image.format == FileImage::kWebp);
  if (std::ranges::find(notes, note) == notes.end()) notes.push_back(note);
  return {format, encode_image(pixels, {format, kNewJpegQuality, numbers})};
}

/// The triangles of one material of one part, with the wedges that they have.
struct MeshPiece {
  std::vector<std::uint32_t> wedges;
  std::vector<std::int32_t> corners;
};

std::map<std::pair<std::uint16_t, std::uint16_t>, MeshPiece> pieces_of(const Mesh& mesh) {
  std::map<std::pair<std::uint16_t, std::uint16_t>, MeshPiece> out;
  std::map<std::pair<std::uint16_t, std::uint16_t>, std::vector<std::int32_t>> numbers;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::pair key{mesh.triangle_part[t], mesh.triangle_material[t]};
    MeshPiece& piece = out[key];
    std::vector<std::int32_t>& number = numbers[key];
    if (number.empty()) number.assign(mesh.wedge_count(), -1);
    for (const std::uint32_t w : mesh.triangles[t]) {
      if (number[w] < 0) {
        number[w] = static_cast<std::int32_t>(piece.wedges.size());
        piece.wedges.push_back(w);
      }
      piece.corners.push_back(number[w]);
    }
  }
  return out;
}

/// One number after the other, of the wedges of a piece.
template <class T>
std::vector<float> flat(const MeshPiece& piece, const T& vector_of) {
  std::vector<float> out;
  for (const std::uint32_t w : piece.wedges)
    for (const float x : vector_of(w)) out.push_back(x);
  return out;
}

/// With v upwards, through the transform of a texture.
std::array<float, 2> usd_texcoord(const UvTransform& transform, Vec2f uv) {
  const Vec2d moved = TexelMap(transform, 1, 1)(uv);
  return {static_cast<float>(moved.x), static_cast<float>(1 - moved.y)};
}

class Stage {
 public:
  Stage(const Model& model, const std::string& entry) : model_(model), entry_(entry) {}

  void add_object(const About& about) {
    crate_.set(0, "defaultPrim", crate_.token("Object"));
    crate_.set(0, "metersPerUnit", crate_.number(about.metres_per_unit > 0 ? about.metres_per_unit : 1.0));
    crate_.set(0, "upAxis", crate_.token("Y"));
    std::vector<NamedText> lines = about_lines(about);
    if (const std::string line = copyright_line(about); !line.empty()) lines.push_back({"copyright", line});
    if (!lines.empty()) {
      std::string words;
      for (const NamedText& l : lines) words += (words.empty() ? "" : "\n") + l.name + ": " + l.text;
      crate_.set(0, "documentation", crate_.text(words));
      crate_.set(0, "customLayerData", crate_.dictionary(unique_names(lines)));
    }
    object_ = crate_.prim(0, "Object", "Xform");
    crate_.set(object_, "kind", crate_.token("component"));
    const Vec3d o = model_.mesh.origin;
    if (o.x != 0 || o.y != 0 || o.z != 0) {
      crate_.attribute(object_, "xformOp:transform", "matrix4d",
                       crate_.matrix({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, o.x, o.y, o.z, 1}));
      crate_.set(
          crate_.attribute(object_, "xformOpOrder", "token[]", crate_.token_array({"xformOp:transform"})),
          "variability", crate_.uniform());
    }
  }

  /// `paths`: of images, by number.
  void add_materials(const std::vector<std::string>& paths) {
    const Node scope = crate_.prim(object_, "Materials", "Scope");
    for (std::size_t m = 0; m < model_.materials.size(); ++m) {
      const bool colours = has_colours(m);
      const Material& material = model_.materials[m];
      if (colours && material.base_colour_texture.used()) refuse(entry_, "vertex colours beside a texture");
      const std::string reason = unsaid_by_preview_surface(material);
      if (!reason.empty()) refuse(entry_, reason);
      materials_.push_back(
          SurfaceWriter(crate_, scope, "Material_" + std::to_string(m), paths).write(material, colours));
    }
  }

  void add_meshes() {
    for (const auto& [key, piece] : pieces_of(model_.mesh))
      add_mesh(piece, "Mesh_" + std::to_string(key.first) + "_" + std::to_string(key.second), key.second);
  }

  Bytes finish() { return crate_.finish(); }

 private:
  static std::vector<NamedText> unique_names(const std::vector<NamedText>& lines) {
    std::vector<NamedText> out;
    for (const NamedText& l : lines) {
      const auto same = std::ranges::find(out, l.name, &NamedText::name);
      if (same == out.end())
        out.push_back(l);
      else
        same->text += "\n" + l.text;
    }
    return out;
  }

  bool has_colours(std::size_t material) const {
    const Mesh& mesh = model_.mesh;
    if (mesh.colours.empty()) return false;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
      if (mesh.triangle_material[t] == material)
        for (const std::uint32_t w : mesh.triangles[t])
          if (mesh.colours[w] != Vec4f{1, 1, 1, 1}) return true;
    return false;
  }

  /// A primvar of one value a vertex, or what else `interpolation` says.
  void add_primvar(Node prim, const std::string& name, const char* type, CrateWriter::Value value,
                   const char* interpolation = "vertex") {
    crate_.set(crate_.attribute(prim, name, type, value), "interpolation", crate_.token(interpolation));
  }

  /// glTF shows a mesh without normals flat, readers of USD smooth it: it gets the normals of its faces, each
  /// once.
  void add_face_normals(Node prim, const MeshPiece& piece) {
    std::vector<float> normals;
    std::vector<std::int32_t> indices;
    std::map<std::array<float, 3>, std::int32_t> number;
    const Mesh& mesh = model_.mesh;
    for (std::size_t i = 0; i < piece.corners.size(); i += 3) {
      const auto corner = [&](std::size_t k) {
        const auto c = static_cast<std::size_t>(piece.corners[i + k]);
        return to_double(mesh.positions[mesh.wedge_position[piece.wedges[c]]]);
      };
      const Vec3f n = to_float(normalized(cross(corner(1) - corner(0), corner(2) - corner(0))));
      const auto [at, is_new] = number.try_emplace({n.x, n.y, n.z}, static_cast<std::int32_t>(number.size()));
      if (is_new) normals.insert(normals.end(), {n.x, n.y, n.z});
      indices.insert(indices.end(), 3, at->second);
    }
    add_primvar(prim, "primvars:normals", "normal3f[]", crate_.array(normals, 3), "faceVarying");
    crate_.attribute(prim, "primvars:normals:indices", "int[]", crate_.array(indices));
  }

  void add_mesh(const MeshPiece& piece, const std::string& name, std::size_t material) {
    const Mesh& mesh = model_.mesh;
    const auto position = [&](std::uint32_t w) {
      const Vec3f p = mesh.positions[mesh.wedge_position[w]];
      return std::array{p.x, p.y, p.z};
    };
    const Node prim = crate_.prim(object_, name, "Mesh");
    crate_.set(prim, "apiSchemas", crate_.prepended({"MaterialBindingAPI"}));
    const std::vector<float> points = flat(piece, position);
    std::array<float, 6> extent{points[0], points[1], points[2], points[0], points[1], points[2]};
    for (std::size_t i = 0; i < points.size(); ++i) {
      extent[i % 3] = std::min(extent[i % 3], points[i]);
      extent[3 + i % 3] = std::max(extent[3 + i % 3], points[i]);
    }
    crate_.attribute(prim, "extent", "float3[]", crate_.array(extent, 3));
    crate_.attribute(prim, "faceVertexCounts", "int[]",
                     crate_.array(std::vector<std::int32_t>(piece.corners.size() / 3, 3)));
    crate_.attribute(prim, "faceVertexIndices", "int[]", crate_.array(piece.corners));
    crate_.attribute(prim, "points", "point3f[]", crate_.array(points, 3));
    const auto of_corners = [&](const auto& v) {
      return crate_.array(flat(piece,
                               [&](std::uint32_t w) {
                                 return std::array{v[w].x, v[w].y, v[w].z};
                               }),
                          3);
    };
    if (!mesh.normals.empty())
      add_primvar(prim, "normals", "normal3f[]", of_corners(mesh.normals));
    else if (!model_.materials[material].unlit)
      add_face_normals(prim, piece);
    const PreviewSurface& surface = materials_[material];
    for (std::size_t k = 0; k < surface.texcoords.size(); ++k) {
      const auto& [set, transform] = surface.texcoords[k];
      const std::vector<Vec2f>& uv = set == 0 ? mesh.uv0 : mesh.uv1;
      if (uv.empty()) continue;
      add_primvar(
          prim, "primvars:" + texcoord_name(k), "texCoord2f[]",
          crate_.array(flat(piece, [&](std::uint32_t w) { return usd_texcoord(transform, uv[w]); }), 2));
    }
    if (surface.colours) add_primvar(prim, "primvars:displayColor", "color3f[]", of_corners(mesh.colours));
    crate_.set(crate_.attribute(prim, "subdivisionScheme", "token", crate_.token("none")), "variability",
               crate_.uniform());
    if (model_.materials[material].double_sided)
      crate_.set(crate_.attribute(prim, "doubleSided", "bool", crate_.flag(true)), "variability",
                 crate_.uniform());
    crate_.relationship(prim, "material:binding", surface.material);
  }

  CrateWriter crate_;
  const Model& model_;
  const std::string& entry_;
  Node object_ = 0;
  std::vector<PreviewSurface> materials_;
};

/// Whether an image holds colours, as the materials use it.
bool is_colour(const Model& model, std::size_t image) {
  const auto k = static_cast<std::int32_t>(image);
  return std::ranges::any_of(model.materials, [&](const Material& m) {
    return m.base_colour_texture.image == k || m.emissive_texture.image == k;
  });
}

}  // namespace

Usdz usdz_of(const Extracted& extracted, const About& about, const std::string& entry,
             const RunContext& context) {
  if (extracted.levels.size() > 1) refuse(entry, "levels of detail");
  GlbParts parts = read_glb(extracted.glb, entry);
  std::vector<FileImageData> images = take_images(parts);
  NoFiles none;
  const Model model =
      import_package_glb(entry, glb_container(parts.root.dump(), parts.binary), none, context).model;
  Usdz out;
  std::vector<std::pair<std::string, Bytes>> files;
  std::vector<std::string> paths;
  for (std::size_t k = 0; k < model.images.size(); ++k) {
    FileImageData image =
        readable(std::move(images.at(std::stoul(model.images[k].name))), !is_colour(model, k), out.notes);
    paths.push_back("textures/" + std::to_string(k) + (image.format == FileImage::kPng ? ".png" : ".jpg"));
    files.emplace_back(paths.back(), std::move(image.bytes));
  }
  Stage stage(model, entry);
  stage.add_object(about);
  stage.add_materials(paths);
  stage.add_meshes();
  ContainerWriter zip([&](ByteSpan bytes) { out.file.insert(out.file.end(), bytes.begin(), bytes.end()); });
  zip.add("model.usdc", stage.finish());  // the first file is the one that viewers open
  for (const auto& [path, bytes] : files) zip.add(path, bytes);
  zip.finish();
  return out;
}

namespace {

class UsdzFiles {
 public:
  UsdzFiles(PackageReader& package, ExtractRequest request, const RunContext& context)
      : package_(package), request_(std::move(request)), context_(context) {
    const OutputTransform place = output_transform(package.about(), Vec3d{}, request_.keep_units);
    about_ = transformed_about(package.about(), place);
  }

  std::vector<Extracted> run() {
    const auto* asked = std::get_if<ExtractBudget>(&request_.file);
    if (!asked) return {converted(extract_model(package_, request_, context_))};
    std::vector<Extracted> out;
    for (const std::uint64_t bytes : std::vector(asked->bytes)) out.push_back(within(bytes));
    return out;
  }

 private:
  Extracted converted(Extracted file) const {
    Usdz usdz = usdz_of(file, about_, package_.store().name(), context_);
    const std::uint64_t before = file.glb.size();
    file.glb = std::move(usdz.file);
    const std::uint64_t pictures = before - file.mesh_bytes;
    file.mesh_bytes = file.glb.size() > pictures ? file.glb.size() - pictures : 0;
    file.notes.insert(file.notes.end(), usdz.notes.begin(), usdz.notes.end());
    if (!package_.annotations().list.empty())
      file.notes.emplace_back("a USDZ has no notes; texmesh dump PKG annotations prints them");
    return file;
  }

  /// A mesh takes more bytes here than coded in a GLB, so the GLB must be smaller than the wish: by the ratio
  /// of the two, then between the largest one that kept within it and the smallest that did not.
  Extracted within(std::uint64_t bytes) {
    constexpr int kTries = 4, kMostTries = 16;
    constexpr double kNearEnough = 0.95, kLeastStep = 0.8;
    const auto wish = static_cast<double>(bytes);
    double low = 0, high = wish, next = wish;
    std::optional<Extracted> best, smallest;
    bool is_least = false;
    for (int k = 0; best ? k < kTries : k < kMostTries && !is_least; ++k) {
      std::get<ExtractBudget>(request_.file).bytes = {static_cast<std::uint64_t>(std::max(next, 1.0))};
      Extracted file = extract_model(package_, request_, context_);
      const auto glb = static_cast<double>(file.glb.size());
      is_least = !file.within;
      file = converted(std::move(file));
      const auto size = static_cast<double>(file.glb.size());
      const bool fits = size <= wish;
      if (!smallest || file.glb.size() < smallest->glb.size()) smallest = file;
      if (fits && (!best || file.glb.size() > best->glb.size())) best = std::move(file);
      if (fits && (size >= kNearEnough * wish || next >= wish)) break;
      if (fits)
        low = next;
      else
        high = std::min(next, glb);
      next = low > 0 ? (low + high) / 2 : std::min(high * wish / size, kLeastStep * high);
    }
    Extracted out = best ? std::move(*best) : std::move(*smallest);
    out.asked_bytes = bytes;
    out.within = out.glb.size() <= bytes;
    return out;
  }

  PackageReader& package_;
  ExtractRequest request_;
  const RunContext& context_;
  About about_;
};

/// Images that no USDZ holds are JPEG or PNG from the start, so that they are coded once. Returns what was
/// asked for.
ExtractImages choose_images(ExtractImages& images) {
  return std::exchange(images, images == ExtractImages::kPng ? images : ExtractImages::kJpeg);
}

}  // namespace

std::vector<Extracted> extract_usdz(PackageReader& package, ExtractRequest request,
                                    const RunContext& context) {
  const std::string entry = package.store().name();
  ExtractImages asked = ExtractImages::kAuto;
  if (auto* scale = std::get_if<ExtractScale>(&request.file)) {
    if (scale->form == ExtractScale::Form::kLevels) refuse(entry, "levels of detail");
    asked = choose_images(scale->images);
  } else if (auto* budget = std::get_if<ExtractBudget>(&request.file)) {
    if (budget->levels) refuse(entry, "levels of detail");
    asked = choose_images(budget->images);
  }
  std::vector<Extracted> files = UsdzFiles(package, std::move(request), context).run();
  if (asked == ExtractImages::kWebp || asked == ExtractImages::kAvif)
    for (Extracted& file : files)
      if (!file.images.empty()) file.notes.push_back(note_of_other_images(asked == ExtractImages::kWebp));
  return files;
}

}  // namespace texmesh
