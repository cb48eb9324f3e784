#include "pipeline/import/gltf/import_gltf_nodes.h"

#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>

namespace texmesh::gltf {
namespace {

Affine from_matrix(const Source& source, const std::vector<double>& v, const std::string& place) {
  Affine a;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 4; ++j) a.at(i, j) = v[static_cast<std::size_t>(j * 4 + i)];
  }
  if (v[3] != 0 || v[7] != 0 || v[11] != 0 || v[15] != 1) {
    source.note_once(Severity::kWarning, "projective-matrix", place,
                     "the last row of a matrix is taken as 0 0 0 1");
  }
  return a;
}

Affine from_rotation(const Source& source, const std::vector<double>& q, const std::string& place) {
  const double l = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(l > 0) || !std::isfinite(l)) {
    source.note_once(Severity::kWarning, "bad-rotation", place,
                     "a quaternion of no length is taken as no rotation");
    return {};
  }
  const double x = q[0] / l, y = q[1] / l, z = q[2] / l, w = q[3] / l;
  Affine a;
  a.m = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),     0,
         2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),     0,
         2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y), 0};
  return a;
}

Affine local_map(const Source& source, const tinygltf::Node& node, std::size_t index) {
  const std::string place = "/nodes/" + std::to_string(index);
  if (!node.matrix.empty()) return from_matrix(source, node.matrix, place + "/matrix");
  Affine a;
  if (!node.rotation.empty()) a = from_rotation(source, node.rotation, place + "/rotation");
  for (int i = 0; i < 3 && !node.scale.empty(); ++i) {
    for (int j = 0; j < 3; ++j) a.at(j, i) *= node.scale[static_cast<std::size_t>(i)];
  }
  for (int i = 0; i < 3 && !node.translation.empty(); ++i) {
    a.at(i, 3) = node.translation[static_cast<std::size_t>(i)];
  }
  return a;
}

std::vector<int> scene_roots(const Source& source, const tinygltf::Model& model) {
  if (!model.scenes.empty()) {
    const auto scene = static_cast<std::size_t>(std::max(model.defaultScene, 0));
    if (model.scenes.size() > 1) {
      add_info(
          source.notes, "other-scenes", "/scenes",
          "only scene " + std::to_string(scene) + " of " + std::to_string(model.scenes.size()) + " is read");
    }
    return model.scenes[scene].nodes;
  }
  std::vector<bool> is_child(model.nodes.size());
  for (const tinygltf::Node& node : model.nodes) {
    for (const int c : node.children) is_child[static_cast<std::size_t>(c)] = true;
  }
  std::vector<int> roots;
  for (std::size_t n = 0; n < is_child.size(); ++n) {
    if (!is_child[n]) roots.push_back(static_cast<int>(n));
  }
  return roots;
}

}  // namespace

Affine operator*(const Affine& a, const Affine& b) {
  Affine c;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 4; ++j) {
      c.at(i, j) = a.at(i, 0) * b.at(0, j) + a.at(i, 1) * b.at(1, j) + a.at(i, 2) * b.at(2, j) +
                   (j == 3 ? a.at(i, 3) : 0);
    }
  }
  return c;
}

Vec3d operator*(const Affine& a, Vec3d p) {
  Vec3d r;
  for (int i = 0; i < 3; ++i) r[i] = a.at(i, 0) * p.x + a.at(i, 1) * p.y + a.at(i, 2) * p.z + a.at(i, 3);
  return r;
}

std::vector<Instance> find_instances(const Source& source, const tinygltf::Model& model) {
  // No recursion: a chain may be as long as the file allows.
  struct Pending {
    int node;
    Affine to_scene;
  };
  std::vector<Pending> stack;
  const std::vector<int> roots = scene_roots(source, model);
  for (auto r = roots.rbegin(); r != roots.rend(); ++r) stack.push_back({*r, {}});
  std::vector<bool> seen(model.nodes.size());
  std::vector<Instance> found;
  while (!stack.empty()) {
    const Pending p = stack.back();
    stack.pop_back();
    const auto n = static_cast<std::size_t>(p.node);
    if (seen[n]) {
      source.fail("/nodes/" + std::to_string(n), "a tree of nodes", "a node with two parents, or a cycle");
    }
    seen[n] = true;
    const tinygltf::Node& node = model.nodes[n];
    const Affine to_scene = p.to_scene * local_map(source, node, n);
    if (node.mesh >= 0) found.push_back({n, static_cast<std::size_t>(node.mesh), to_scene});
    for (auto c = node.children.rbegin(); c != node.children.rend(); ++c) stack.push_back({*c, to_scene});
  }
  return found;
}

}  // namespace texmesh::gltf
