#include "stages/gltf/check_glb_nodes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <tuple>

#include "format/base/box.h"

namespace texmesh {
namespace {

using Json = GlbDocument::Json;
using Matrix = std::array<double, 16>;  // column-major, as glTF

Matrix product_of(const Matrix& a, const Matrix& b) {
  Matrix product{};
  for (std::size_t c = 0; c < 4; ++c)
    for (std::size_t r = 0; r < 4; ++r)
      for (std::size_t k = 0; k < 4; ++k) product[c * 4 + r] += a[k * 4 + r] * b[c * 4 + k];
  return product;
}

Vec3d transformed(const Matrix& m, const Vec3d& p) {
  return {m[0] * p.x + m[4] * p.y + m[8] * p.z + m[12], m[1] * p.x + m[5] * p.y + m[9] * p.z + m[13],
          m[2] * p.x + m[6] * p.y + m[10] * p.z + m[14]};
}

/// The numbers under `key`, `fallback` when absent.
std::vector<double> numbers(GlbDocument& d, const Json& node, const char* key, std::vector<double> fallback,
                            const std::string& place) {
  const auto it = node.find(key);
  if (it == node.end()) return fallback;
  std::vector<double> v;
  if (it->is_array())
    for (const Json& x : *it)
      v.push_back(x.is_number() ? x.get<double>() : std::numeric_limits<double>::infinity());
  if (v.size() != fallback.size() ||
      !std::all_of(v.begin(), v.end(), [](double x) { return std::isfinite(x); }))
    d.fail("glb-node", place + "/" + key, std::to_string(fallback.size()) + " numbers",
           it->dump().substr(0, 80));
  return v;
}

Matrix local_matrix(GlbDocument& d, const Json& node, const std::string& place) {
  Matrix m{};
  if (node.contains("matrix")) {
    const auto v = numbers(d, node, "matrix", std::vector<double>(16), place);
    std::copy(v.begin(), v.end(), m.begin());
    return m;
  }
  const auto t = numbers(d, node, "translation", {0, 0, 0}, place),
             s = numbers(d, node, "scale", {1, 1, 1}, place),
             q = numbers(d, node, "rotation", {0, 0, 0, 1}, place);
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  const std::array<double, 9> r{1 - 2 * (y * y + z * z), 2 * (x * y + z * w),     2 * (x * z - y * w),
                                2 * (x * y - z * w),     1 - 2 * (x * x + z * z), 2 * (y * z + x * w),
                                2 * (x * z + y * w),     2 * (y * z - x * w),     1 - 2 * (x * x + y * y)};
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t k = 0; k < 3; ++k) m[c * 4 + k] = r[c * 3 + k] * s[c];
    m[12 + c] = t[c];
  }
  m[15] = 1;
  return m;
}

class NodeChecker {
 public:
  NodeChecker(GlbDocument& document, const std::vector<std::vector<Vec3d>>& mesh_positions)
      : d_(document), mesh_positions_(mesh_positions), nodes_(document.array(document.root(), "nodes", "")) {}

  void run(GlbFacts& facts) {
    find_parents();
    check_scenes();
    collect_positions(facts);
  }

 private:
  void find_parents() {
    parent_.assign(nodes_.size(), -1);
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const std::string place = GlbDocument::element("nodes", i);
      if (nodes_[i].contains("mesh")) d_.index(nodes_[i], "mesh", mesh_positions_.size(), place);
      const Json& children = d_.array(nodes_[i], "children", place);
      for (std::size_t k = 0; k < children.size(); ++k) {
        const std::uint64_t c =
            children[k].is_number_unsigned() ? children[k].get<std::uint64_t>() : nodes_.size();
        if (c >= nodes_.size())
          d_.fail("glb-reference", place + "/children/" + std::to_string(k), "a node", children[k].dump());
        if (parent_[c] >= 0 || c == i)
          d_.fail("glb-node", GlbDocument::element("nodes", c), "one parent", "two");
        parent_[c] = static_cast<std::int64_t>(i);
      }
    }
  }

  void check_scenes() {
    const Json& scenes = d_.array(d_.root(), "scenes", "");
    d_.index(d_.root(), "scene", scenes.size(), "");
    for (std::size_t i = 0; i < scenes.size(); ++i)
      for (const Json& root : d_.array(scenes[i], "nodes", GlbDocument::element("scenes", i))) {
        const std::uint64_t n = root.is_number_unsigned() ? root.get<std::uint64_t>() : nodes_.size();
        if (n >= nodes_.size() || parent_[n] >= 0)
          d_.fail("glb-node", GlbDocument::element("scenes", i) + "/nodes", "root nodes", root.dump());
      }
  }

  void collect_positions(GlbFacts& facts) {
    std::vector<Vec3d>& all = facts.positions;
    Box3d box;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const Matrix m = world_matrix(i);
      if (!nodes_[i].contains("mesh")) continue;
      for (const Vec3d& p : mesh_positions_[nodes_[i]["mesh"].get<std::size_t>()]) {
        all.push_back(transformed(m, p));
        box.extend(all.back());
      }
    }
    const auto tuple_of = [](const Vec3d& p) { return std::tie(p.x, p.y, p.z); };
    std::sort(all.begin(), all.end(),
              [&](const Vec3d& p, const Vec3d& q) { return tuple_of(p) < tuple_of(q); });
    all.erase(std::unique(all.begin(), all.end()), all.end());
    facts.has_bounds = !box.empty();
    if (!box.empty()) facts.bounds_min = box.min, facts.bounds_max = box.max;
  }

  Matrix world_matrix(std::size_t i) {
    const auto local = [&](std::size_t node) {
      return local_matrix(d_, nodes_[node], GlbDocument::element("nodes", node));
    };
    Matrix m = local(i);
    std::size_t steps = 0;
    for (std::int64_t p = parent_[i]; p >= 0; p = parent_[static_cast<std::size_t>(p)]) {
      if (++steps > nodes_.size()) d_.fail("glb-node", GlbDocument::element("nodes", i), "a tree", "a cycle");
      m = product_of(local(static_cast<std::size_t>(p)), m);
    }
    return m;
  }

  GlbDocument& d_;
  const std::vector<std::vector<Vec3d>>& mesh_positions_;
  const Json& nodes_;
  std::vector<std::int64_t> parent_;  // per node, -1 for a root
};

}  // namespace

void check_glb_nodes(GlbDocument& document, const std::vector<std::vector<Vec3d>>& mesh_positions,
                     GlbFacts& facts) {
  NodeChecker(document, mesh_positions).run(facts);
}

}  // namespace texmesh
