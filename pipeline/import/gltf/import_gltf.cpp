#include <tiny_gltf.h>

#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "pipeline/about/gltf_about.h"
#include "pipeline/import/finish_model.h"
#include "pipeline/import/gltf/import_gltf_assembler.h"
#include "pipeline/import/gltf/import_gltf_nodes.h"
#include "pipeline/import/gltf/import_gltf_parts.h"

namespace texmesh {
namespace gltf {
namespace {

constexpr std::size_t kMaxParts = 65535;          // Mesh::triangle_part is 16 bits wide
constexpr std::size_t kMaxGltfMaterials = 65535;  // and so is triangle_material

/// Reads each primitive once; keeps it only while further nodes show the same mesh.
class PrimitiveCache {
 public:
  explicit PrimitiveCache(const std::vector<Instance>& instances) {
    for (const Instance& i : instances) ++left_[i.mesh];
  }
  template <class F>
  std::shared_ptr<const std::vector<Primitive>> get(std::size_t mesh, F&& read) {
    auto& kept = kept_[mesh];
    if (!kept) kept = std::make_shared<const std::vector<Primitive>>(read());
    auto result = kept;
    if (--left_[mesh] == 0) kept_.erase(mesh);
    return result;
  }

 private:
  std::map<std::size_t, std::size_t> left_;
  std::map<std::size_t, std::shared_ptr<const std::vector<Primitive>>> kept_;
};

class GltfReader {
 public:
  GltfReader(const Source& source, ByteSpan bytes, Model& model)
      : source_(source),
        container_(split_container(source, bytes)),
        document_(checked(source, container_, about_)),
        structure_(parse_structure(source, document_)),
        buffers_(source, document_, container_.bin),
        model_(model) {}
  void read();
  bool is_glb() const { return container_.is_glb; }
  const About& about() const { return about_; }

 private:
  static Json checked(const Source& source, const Container& container, About& about) {
    Json document = parse_json(source, container.json);
    about = about_from_gltf(document, container.is_glb ? "glb" : "gltf", source.notes);
    check_document(source, document);
    return document;
  }
  std::map<int, std::uint16_t> read_used_materials(const std::vector<Instance>& instances);
  std::uint16_t add_part(const Instance& instance);
  void drop_textures_without_uv();

  const Source& source_;
  const Container container_;
  About about_;
  const Json document_;
  const tinygltf::Model structure_;
  Buffers buffers_;
  Model& model_;
};

/// In the order of the file, -1 (glTF's default material) first.
std::map<int, std::uint16_t> GltfReader::read_used_materials(const std::vector<Instance>& instances) {
  std::map<int, std::uint16_t> index;
  for (const Instance& i : instances) {
    for (const tinygltf::Primitive& p : structure_.meshes[i.mesh].primitives) index[p.material] = 0;
  }
  if (index.size() > kMaxGltfMaterials) {
    source_.fail("/materials", "at most " + std::to_string(kMaxGltfMaterials), std::to_string(index.size()));
  }
  std::vector<int> used;
  for (const auto& [material, unset] : index) used.push_back(material);
  const std::vector<std::uint16_t> read =
      read_materials(source_, document_, structure_, buffers_, used, model_);
  for (std::size_t i = 0; i < used.size(); ++i) index[used[i]] = read[i];
  return index;
}

std::uint16_t GltfReader::add_part(const Instance& instance) {
  std::vector<std::string>& names = model_.mesh.part_names;
  if (names.size() == kMaxParts) {
    source_.note_once(Severity::kInfo, "many-parts", "/nodes", "the nodes after the 65534th are one part");
    return static_cast<std::uint16_t>(kMaxParts - 1);
  }
  std::string name = structure_.nodes[instance.node].name;
  if (name.empty()) name = structure_.meshes[instance.mesh].name;
  if (name.empty()) name = "node " + std::to_string(instance.node);
  names.push_back(std::move(name));
  return static_cast<std::uint16_t>(names.size() - 1);
}

void GltfReader::drop_textures_without_uv() {
  const bool has_uv[2] = {!model_.mesh.uv0.empty(), !model_.mesh.uv1.empty()};
  for (Material& m : model_.materials) {
    for_each_texture(m, [&](TextureRef& ref) {
      if (!ref.used() || has_uv[ref.texcoord]) return;
      source_.note_once(
          Severity::kWarning, "texture-without-uv", m.name,
          "no mesh has TEXCOORD_" + std::to_string(ref.texcoord) + "; its textures are left out");
      ref = {};
    });
  }
}

void GltfReader::read() {
  const std::vector<Instance> instances = find_instances(source_, structure_);
  bool with_normals = false;
  for (const Instance& i : instances) {
    for (std::size_t p = 0; p < structure_.meshes[i.mesh].primitives.size(); ++p) {
      with_normals |= primitive_has(structure_, i.mesh, p, "NORMAL");
    }
  }
  const std::map<int, std::uint16_t> materials = read_used_materials(instances);
  PrimitiveCache cache(instances);
  Assembler assembler(source_, model_.mesh, with_normals);
  for (std::size_t i = 0; i < instances.size(); ++i) {
    source_.context.check_cancelled();
    source_.context.report(static_cast<double>(i) / static_cast<double>(instances.size()));
    const Instance& instance = instances[i];
    const std::vector<tinygltf::Primitive>& declared = structure_.meshes[instance.mesh].primitives;
    const auto primitives = cache.get(instance.mesh, [&] {
      std::vector<Primitive> read;
      for (std::size_t p = 0; p < declared.size(); ++p) {
        read.push_back(read_primitive(source_, document_, structure_, buffers_, instance.mesh, p));
      }
      return read;
    });
    const std::uint16_t part = add_part(instance);
    for (std::size_t p = 0; p < declared.size(); ++p) {
      assembler.add((*primitives)[p], instance.to_scene, materials.at(declared[p].material), part);
    }
  }
  assembler.finish();
  drop_textures_without_uv();
}

ImportedModel read_gltf(const std::string& file_name, ByteSpan bytes, Resolver& resolver,
                        const ImportOptions& options, const RunContext& context, double largest_coordinate) {
  ImportedModel out;
  // glTF 2.0, 3.8.3: colour space information of PNG and JPEG must be ignored.
  ImportOptions by_specification = options;
  if (by_specification.colour_profiles == ProfilePolicy::kAuto)
    by_specification.colour_profiles = ProfilePolicy::kIgnore;
  const Source source{file_name, resolver, by_specification, context, out.model.notes, largest_coordinate};
  GltfReader reader(source, bytes, out.model);
  reader.read();
  out.format = reader.is_glb() ? "glb" : "gltf";
  out.about = reader.about();
  out.normals_by_specification = true;
  finish_model(out.model, file_name, options);
  return out;
}

}  // namespace
}  // namespace gltf

ImportedModel import_gltf(const std::string& file_name, std::span<const std::uint8_t> bytes,
                          Resolver& resolver, const ImportOptions& options, const RunContext& context) {
  return gltf::read_gltf(file_name, bytes, resolver, options, context, kLargestCoordinate);
}

ImportedModel import_package_glb(const std::string& file_name, std::span<const std::uint8_t> bytes,
                                 Resolver& resolver, const RunContext& context) {
  return gltf::read_gltf(file_name, bytes, resolver, {}, context, kLargestPackedCoordinate);
}

}  // namespace texmesh
