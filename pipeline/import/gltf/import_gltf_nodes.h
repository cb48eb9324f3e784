#pragma once
#include <array>
#include <cstddef>
#include <vector>

#include "format/base/vec.h"
#include "pipeline/import/gltf/import_gltf_parts.h"

namespace texmesh::gltf {

/// Affine map, row-major 3 x 4, in double precision: georeferenced scenes place small meshes
/// with large translations.
struct Affine {
  std::array<double, 12> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  double at(int row, int column) const { return m[static_cast<std::size_t>(row * 4 + column)]; }
  double& at(int row, int column) { return m[static_cast<std::size_t>(row * 4 + column)]; }
};

Affine operator*(const Affine& a, const Affine& b);
Vec3d operator*(const Affine& a, Vec3d p);

/// A node that shows a mesh, with its map to the scene's space.
struct Instance {
  std::size_t node = 0, mesh = 0;
  Affine to_scene;
};

/// The instances of the scene that is read, depth first in the order of the file. InputError when the nodes
/// are no tree.
std::vector<Instance> find_instances(const Source& source, const tinygltf::Model& model);

}  // namespace texmesh::gltf
