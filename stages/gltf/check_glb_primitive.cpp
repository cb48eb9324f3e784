#include "stages/gltf/check_glb_primitive.h"

#include <draco/compression/decode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

namespace texmesh {
namespace {

using Json = GlbDocument::Json;

class PrimitiveChecker {
 public:
  explicit PrimitiveChecker(GlbDocument& document) : d_(document) {}

  GlbPrimitive check(const Json& json, const std::string& place) {
    if (d_.number(json, "mode", 4, place) != 4)
      d_.fail("glb-reference", place + "/mode", "4, triangles", json["mode"].dump());
    if (json.contains("material"))
      d_.index(json, "material", d_.array(d_.root(), "materials", "").size(), place);
    const auto attributes = json.find("attributes");
    if (attributes == json.end() || !attributes->is_object() || !attributes->contains("POSITION"))
      d_.fail("glb-reference", place + "/attributes/POSITION", "an accessor", "nothing");
    const auto& position = accessor(*attributes, "POSITION", place + "/attributes");
    if (position.components != 3)
      d_.fail("glb-accessor", place + "/attributes/POSITION", "VEC3", "another type");
    for (const auto& [name, value] : attributes->items()) {
      const auto& a = accessor(*attributes, name.c_str(), place + "/attributes");
      if (a.count != position.count)
        d_.fail("glb-accessor", place + "/attributes/" + name,
                std::to_string(position.count) + " elements, as POSITION", std::to_string(a.count));
    }
    const auto& indices = accessor(json, "indices", place);
    if (indices.components != 1 || indices.count % 3 != 0 || indices.component_type == 5126)
      d_.fail("glb-accessor", place + "/indices", "a multiple of 3 integers", std::to_string(indices.count));
    GlbPrimitive p{indices.count / 3, position.count, {}, {}};
    const auto extensions = json.find("extensions");
    const bool draco = extensions != json.end() && extensions->is_object() &&
                       extensions->contains("KHR_draco_mesh_compression");
    if (draco) {
      check_draco((*extensions)["KHR_draco_mesh_compression"], *attributes, p, place);
    } else {
      check_indices(indices, position.count, place);
      for (std::size_t v = 0; v < different(position); ++v)
        p.add({finite(position, v, 0, place), finite(position, v, 1, place), finite(position, v, 2, place)});
    }
    check_stated_box(d_.root()["accessors"][(*attributes)["POSITION"].get<std::size_t>()], p.box,
                     place + "/attributes/POSITION");
    return p;
  }

 private:
  const GlbDocument::Accessor& accessor(const Json& object, const char* key, const std::string& place) {
    const auto& a = d_.accessors()[d_.index(object, key, d_.accessors().size(), place)];
    if (!a.ok) throw GlbDocument::Broken{};  // it has its finding
    return a;
  }

  /// Of elements that no byte stands for, which may be four billion, one says what all are.
  static std::size_t different(const GlbDocument::Accessor& a) {
    return a.view < 0 ? std::min<std::size_t>(a.count, 1) : a.count;
  }

  double finite(const GlbDocument::Accessor& a, std::size_t i, std::size_t c, const std::string& place) {
    const double v = d_.value(a, i, c);
    if (!std::isfinite(v))
      d_.fail("glb-position", place + "/attributes/POSITION", "finite positions",
              "element " + std::to_string(i));
    return v;
  }

  void check_indices(const GlbDocument::Accessor& indices, std::size_t vertices, const std::string& place) {
    for (std::size_t i = 0; i < different(indices); ++i) {
      const double v = d_.value(indices, i, 0);
      if (v >= static_cast<double>(vertices))
        d_.fail("glb-index", place + "/indices", "indices below " + std::to_string(vertices),
                std::to_string(static_cast<std::uint64_t>(v)) + " at " + std::to_string(i));
    }
  }

  void check_draco(const Json& extension, const Json& attributes, GlbPrimitive& p, const std::string& place) {
    const std::string at = place + "/extensions/KHR_draco_mesh_compression";
    const auto& view = d_.views()[d_.index(extension, "bufferView", d_.views().size(), at)];
    if (!view.ok) throw GlbDocument::Broken{};
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(view.data.data()), view.data.size());
    auto decoded = draco::Decoder().DecodeMeshFromBuffer(&buffer);
    if (!decoded.ok()) d_.fail("glb-decode", at, "a Draco mesh", decoded.status().error_msg_string());
    const draco::Mesh& mesh = *decoded.value();
    if (mesh.num_faces() != p.triangles)
      d_.fail("glb-decode", place + "/indices", std::to_string(mesh.num_faces()) + " triangles, as decoded",
              std::to_string(p.triangles));
    if (mesh.num_points() != p.vertices)
      d_.fail("glb-decode", place + "/attributes/POSITION",
              std::to_string(mesh.num_points()) + " vertices, as decoded", std::to_string(p.vertices));
    for (draco::FaceIndex f(0); f < mesh.num_faces(); ++f)
      for (const draco::PointIndex& corner : mesh.face(f))
        if (corner.value() >= mesh.num_points())
          d_.fail("glb-index", at, "indices below " + std::to_string(mesh.num_points()),
                  std::to_string(corner.value()));
    const auto ids = extension.find("attributes");
    for (const auto& [name, value] : attributes.items()) {
      if (ids == extension.end() || !ids->is_object() || !ids->contains(name))
        continue;  // stored without Draco
      const auto id = static_cast<std::uint32_t>(d_.number(*ids, name.c_str(), 0, at + "/attributes"));
      const draco::PointAttribute* a = mesh.GetAttributeByUniqueId(id);
      const auto& stated = accessor(attributes, name.c_str(), place + "/attributes");
      if (!a || static_cast<std::size_t>(a->num_components()) != stated.components)
        d_.fail("glb-decode", at + "/attributes/" + name,
                std::to_string(stated.components) + " components in attribute " + std::to_string(id),
                a ? std::to_string(a->num_components()) : "no such attribute");
      if (name == "POSITION") add_draco_positions(mesh, *a, p, at);
    }
    if (p.box.empty())
      d_.fail("glb-decode", at + "/attributes/POSITION", "positions in the Draco data", "none");
  }

  void add_draco_positions(const draco::Mesh& mesh, const draco::PointAttribute& a, GlbPrimitive& out,
                           const std::string& at) {
    for (draco::PointIndex i(0); i < mesh.num_points(); ++i) {
      std::array<float, 3> v{};
      const bool read = a.ConvertValue<float>(a.mapped_index(i), 3, v.data());
      if (!read || !std::isfinite(v[0]) || !std::isfinite(v[1]) || !std::isfinite(v[2]))
        d_.fail("glb-position", at + "/attributes/POSITION", "finite positions",
                "point " + std::to_string(i.value()));
      out.add({v[0], v[1], v[2]});
    }
  }

  /// glTF requires min and max of POSITION; viewers place their camera by them.
  void check_stated_box(const Json& accessor_json, const Box3d& box, const std::string& place) {
    const double slack = 1e-5 * length(box.max - box.min) + 1e-30;
    for (const char* key : {"min", "max"}) {
      const auto it = accessor_json.find(key);
      if (it == accessor_json.end() || !it->is_array() || it->size() != 3 ||
          !std::all_of(it->begin(), it->end(), [](const Json& x) { return x.is_number(); }))
        d_.fail("glb-accessor", place + "/" + key, "three numbers",
                it == accessor_json.end() ? "nothing" : it->dump().substr(0, 80));
      const Vec3d& real = key[1] == 'i' ? box.min : box.max;
      for (int k = 0; k < 3; ++k)
        if (!(std::fabs((*it)[static_cast<std::size_t>(k)].get<double>() - real[k]) <= slack))
          d_.fail("glb-position", place + "/" + key, Json{real.x, real.y, real.z}.dump(),
                  it->dump().substr(0, 120));
    }
  }

  GlbDocument& d_;
};

}  // namespace

GlbPrimitive check_glb_primitive(GlbDocument& document, const Json& json, const std::string& place) {
  return PrimitiveChecker(document).check(json, place);
}

}  // namespace texmesh
