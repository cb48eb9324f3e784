#pragma once
#include <cstdint>
#include <vector>

#include "format/model/model.h"
#include "pipeline/import/gltf/import_gltf_nodes.h"
#include "pipeline/import/gltf/import_gltf_parts.h"

namespace texmesh::gltf {

/// Puts primitives together to one mesh in the scene's space.
class Assembler {
 public:
  Assembler(const Source& source, Mesh& mesh, bool with_normals)
      : source_(source), mesh_(mesh), with_normals_(with_normals) {}
  void add(const Primitive& primitive, const Affine& to_scene, std::uint16_t material, std::uint16_t part);
  void finish();

 private:
  void check_room(const Primitive& primitive, std::size_t new_wedges) const;
  void add_wedge(const Primitive& primitive, std::uint32_t vertex, std::uint32_t first_position,
                 Vec3f normal);
  void add_tangents(const Primitive& primitive, const Affine& to_scene, bool mirrored);

  const Source& source_;
  Mesh& mesh_;
  const bool with_normals_;
  std::vector<Vec3d> positions_;
};

}  // namespace texmesh::gltf
