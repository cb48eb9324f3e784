// The only implementation of tinygltf in texmesh: without its image codecs and without its file system, so
// that it can neither open nor decode anything. Its loader takes the text of a file, loads every buffer and
// refuses index accessors without a bufferView, which is what Draco primitives have. So its readers of single
// elements, which the loader calls, are called here, on the document that is parsed already. They belong to
// tinygltf 2.7: another version that has them not, or others, does not compile.
// nlohmann's header comes first: tinygltf would include it with hidden visibility.
#include <fstream>
#include <nlohmann/json.hpp>

#define TINYGLTF_IMPLEMENTATION
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_FS
#include <tiny_gltf.h>

#include "pipeline/import/gltf/import_gltf_parts.h"

namespace texmesh {
namespace {

class StructureReader {
 public:
  StructureReader(const Source& source, const GltfJson& document) : source_(source), document_(document) {}

  /// read(element, error, JSON) for every element of an array of the document. What tinygltf complains about
  /// is an error, even where it would go on.
  template <class T, class Read>
  void read_array(const std::string& array, std::vector<T>& elements, const Read& read) const {
    const auto it = document_.find(array);
    if (it == document_.end()) return;
    for (const GltfJson& declared : *it) {
      const std::string place = "/" + array + "/" + std::to_string(elements.size());
      read_element(place, declared, elements.emplace_back(), read);
    }
  }
  template <class T, class Read>
  void read_element(const std::string& place, const GltfJson& declared, T& element, const Read& read) const {
    std::string error;
    const bool is_read = read(&element, &error, declared);
    if (is_read && error.empty()) return;
    const std::string words = error.substr(0, std::min<std::size_t>(error.find('\n'), 200));
    source_.fail(place, "glTF 2.0", words.empty() ? "something else" : words);
  }

 private:
  const Source& source_;
  const GltfJson& document_;
};

}  // namespace

tinygltf::Model read_structure(const Source& source, const GltfJson& document) {
  namespace tiny = tinygltf;
  tiny::Model model;
  const StructureReader in(source, document);
  const auto plain = [](auto read) {
    return [read](auto* to, std::string* error, const GltfJson& o) { return read(to, error, o, false); };
  };
  in.read_element("/asset", document["asset"], model.asset, plain(tiny::ParseAsset));
  in.read_array("bufferViews", model.bufferViews, plain(tiny::ParseBufferView));
  in.read_array("accessors", model.accessors, plain(tiny::ParseAccessor));
  in.read_array("meshes", model.meshes, [&](tiny::Mesh* mesh, std::string* error, const GltfJson& o) {
    return tiny::ParseMesh(mesh, &model, error, o, false);
  });
  in.read_array("nodes", model.nodes, plain(tiny::ParseNode));
  in.read_array("scenes", model.scenes, [](tiny::Scene* scene, std::string* error, const GltfJson& o) {
    tiny::ParseIntegerArrayProperty(&scene->nodes, error, o, "nodes", false);
    return true;
  });
  tiny::ParseIntegerProperty(&model.defaultScene, nullptr, document, "scene", false);
  in.read_array("materials", model.materials, plain(tiny::ParseMaterial));
  in.read_array("samplers", model.samplers, plain(tiny::ParseSampler));
  in.read_array("textures", model.textures,
                [](tiny::Texture* texture, std::string* error, const GltfJson& o) {
                  return tiny::ParseTexture(texture, error, o, false, "");
                });
  return model;
}

}  // namespace texmesh
