#include "tools/extract/glb/scale_file.h"

#include "format/split/split_reader.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/gltf/glb_container.h"
#include "stages/image/decode_image.h"

namespace texmesh {
namespace {

StandaloneGlb stored_file(PackageReader& package, int scale) {
  return {package.scale_glb(scale), mesh_path(scale)};
}

/// The mesh that the stream has at a scale.
Mesh mesh_at(SplitStreamReader& reader, int scale, std::span<const std::uint8_t> stream) {
  const auto& scales = reader.head().scales;
  const auto found = std::ranges::find(scales, scale, &SplitScale::scale);
  if (found == scales.end())
    throw FormatError(kSplitStreamPath, "scales", "scale " + std::to_string(scale), "none");
  reader.read_to_scale(static_cast<std::size_t>(found - scales.begin()), stream);
  return split_model(reader.head(), reader.mesh());
}

void fit_to_finest(const Mesh& finest, Mesh& mesh, const RunContext& context) {
  if (mesh.normals.empty()) return;
  std::vector<Vec3d> points;
  for (const std::uint32_t p : mesh.wedge_position) points.push_back(to_double(mesh.positions[p]));
  mesh.normals =
      fit_normals(points, mesh.triangles, std::move(mesh.normals), normal_samples(finest), context);
}

}  // namespace

StandaloneGlb scale_file(PackageReader& package, int scale, const RunContext& context,
                         StreamedNormals normals) {
  const Manifest& m = package.manifest();
  const ManifestScale& wanted = m.scales[package.scale_index(scale)];
  const int coarsest = m.scales.back().scale;
  StandaloneGlb first = stored_file(package, coarsest);
  if (scale == coarsest) return first;
  if (wanted.has_glb()) {
    StandaloneGlb file = stored_file(package, scale);
    file.set_images(first.images());
    return file;
  }
  const bool fitted = normals == StreamedNormals::kFitted;
  const Bytes stream = fitted ? package.entry(kSplitStreamPath) : package.split_prefix(scale);
  SplitStreamReader reader(read_split_head(stream));
  Mesh mesh = mesh_at(reader, scale, stream);
  if (fitted) fit_to_finest(mesh_at(reader, 0, stream), mesh, context);
  ScalesOptions options;
  options.mesh_codec = first.codec();
  first.take_meshes({write_streamed_scale(mesh, reader.head(), options), mesh_path(scale)});
  return first;
}

Model read_model(StandaloneGlb file, const std::string& entry, const RunContext& context) {
  std::map<std::uint32_t, FileImageData> images;
  for (const std::uint32_t i : file.source_images()) {
    const auto byte = [i](int shift) { return static_cast<std::uint8_t>(i >> shift); };
    images[i] = {FileImage::kPng, encode_image({1, 1, 3, {byte(0), byte(8), byte(16)}}, {FileImage::kPng})};
  }
  file.set_images(images);
  NoFiles none;
  return import_package_glb(entry, file.finish(), none, context).model;
}

std::string image_name(std::uint32_t image) { return std::to_string(image); }

namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kTransform = "KHR_texture_transform";

/// Calls f with every reference to a texture of a material, extensions' among them.
template <class F>
void for_each_reference(Json& value, const F& f) {
  if (!value.is_object()) return;
  for (auto& [key, member] : value.items()) {
    if (key.ends_with("Texture") && member.is_object() && member.contains("index")) f(member);
    for_each_reference(member, f);
  }
}

Json transform_of(const Json& reference) {
  if (!reference.contains("extensions") || !reference["extensions"].contains(kTransform)) return nullptr;
  return reference["extensions"][kTransform];
}

}  // namespace

bool bake_texture_scale(Json& root, Mesh& mesh) {
  if (!root.contains("materials")) return true;
  std::vector<Json> found;
  for (Json& material : root["materials"])
    for_each_reference(material, [&](Json& reference) { found.push_back(transform_of(reference)); });
  if (found.empty() || found.front().is_null()) return std::ranges::all_of(found, &Json::is_null);
  const Json first = found.front();
  if (std::ranges::any_of(found, [&](const Json& t) { return t != first; }) || first.size() != 1 ||
      !first.contains("scale") || !mesh.uv1.empty())
    return false;
  const Vec2f scale{first["scale"].at(0).get<float>(), first["scale"].at(1).get<float>()};
  for (Vec2f& uv : mesh.uv0) uv = {uv.x * scale.x, uv.y * scale.y};
  for (Json& material : root["materials"])
    for_each_reference(material, [&](Json& reference) {
      reference["extensions"].erase(kTransform);
      if (reference["extensions"].empty()) reference.erase("extensions");
    });
  return true;
}

namespace {

/// The materials that triangles have, as import counts them.
std::vector<std::size_t> used_materials(const Json& root) {
  std::set<std::size_t> used;
  for (const Json& mesh : root["meshes"])
    for (const Json& p : mesh["primitives"])
      if (p.contains("material")) used.insert(p["material"].get<std::size_t>());
  return {used.begin(), used.end()};
}

std::size_t add_view(GlbParts& to, const Bytes& bytes) {
  pad_to_four(to.binary, 0);
  to.root["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", to.binary.size()}, {"byteLength", bytes.size()}});
  to.binary.insert(to.binary.end(), bytes.begin(), bytes.end());
  return to.root["bufferViews"].size() - 1;
}

/// The image of `from` as a view of `to`; WebP becomes PNG.
Json moved_image(Json image, const GlbParts& from, GlbParts& to) {
  const Json& view = from.root["bufferViews"].at(image["bufferView"].get<std::size_t>());
  const auto first =
      from.binary.begin() + static_cast<std::ptrdiff_t>(view.value("byteOffset", std::size_t{0}));
  Bytes bytes(first, first + view["byteLength"].get<std::ptrdiff_t>());
  if (image.value("mimeType", "") == "image/webp") {
    bytes = encode_image(decode_image(probe_image("image", std::move(bytes), {})), {FileImage::kPng});
    image["mimeType"] = "image/png";
  }
  image["bufferView"] = add_view(to, bytes);
  return image;
}

}  // namespace

StandaloneGlb plain_file(const StandaloneGlb& file, const std::string& entry, const RunContext& context) {
  GlbParts from = read_glb(file.finish(), entry);
  Mesh flat = read_model(file, entry, context).mesh;
  const bool baked = bake_texture_scale(from.root, flat);
  ScalesOptions options;
  options.mesh_codec = MeshCodec::kNone;
  GlbParts to = read_glb(write_streamed_scale(flat, SplitStreamHead{}, options), entry);
  const std::vector<std::size_t> materials = used_materials(from.root);
  for (Json& mesh : to.root["meshes"])
    for (Json& p : mesh["primitives"])
      if (!materials.empty()) p["material"] = materials.at(p.value("material", std::size_t{0}));
  Json root = from.root;
  for (const char* list : {"meshes", "accessors", "bufferViews"}) root[list] = to.root[list];
  std::size_t part = 0;  // nodes with meshes, in the order in which import makes parts of them
  for (Json& node : root["nodes"]) {
    for (const char* key : {"scale", "rotation", "matrix", "translation"}) node.erase(key);
    if (node.contains("mesh")) node["mesh"] = to.root["nodes"].at(part++).at("mesh");
  }
  for (const char* list : {"images", "textures"})
    if (!root.contains(list)) root[list] = Json::array();
  for (Json& image : root["images"]) image = moved_image(image, from, to);
  root["bufferViews"] = to.root["bufferViews"];
  for (Json& texture : root["textures"]) {
    if (!texture.contains("extensions")) continue;
    texture["source"] = texture["extensions"]["EXT_texture_webp"]["source"];
    texture.erase("extensions");
  }
  for (const char* extension : {"KHR_draco_mesh_compression", "EXT_meshopt_compression",
                                "KHR_mesh_quantization", "EXT_texture_webp", "EXT_mesh_features"})
    forget_extension(root, extension);
  if (baked) forget_extension(root, "KHR_texture_transform");
  for (const char* list : {"images", "textures"})
    if (root[list].empty()) root.erase(list);
  pad_to_four(to.binary, 0);
  root["buffers"] = Json::array({{{"byteLength", to.binary.size()}}});
  return {glb_container(root.dump(), to.binary), entry};
}

}  // namespace texmesh
