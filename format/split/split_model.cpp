#include "format/split/split_model.h"

#include <algorithm>

#include "format/base/no_index.h"

namespace texmesh {
namespace {

/// Numbers things in the order of their first use.
class Numbering {
 public:
  explicit Numbering(std::size_t count) : number_(count, kNoIndex) {}
  std::uint32_t of(std::uint32_t old) {
    if (number_[old] == kNoIndex) {
      number_[old] = static_cast<std::uint32_t>(used_.size());
      used_.push_back(old);
    }
    return number_[old];
  }
  const std::vector<std::uint32_t>& used() const { return used_; }

 private:
  std::vector<std::uint32_t> number_, used_;
};

void add_attribute(const SplitAttribute& a, const std::vector<std::int32_t>& values,
                   const std::vector<std::uint32_t>& wedges, Mesh& out) {
  const auto components = static_cast<std::size_t>(split_components(a.kind));
  const float one = static_cast<float>((std::uint32_t{1} << a.grid.bits) - 1);
  for (const std::uint32_t w : wedges) {
    const std::int32_t* v = values.data() + w * components;
    if (a.kind == SplitKind::kNormal) {
      const auto n = octahedral_normal(v[0], v[1], a.grid.bits);
      out.normals.push_back({n[0], n[1], n[2]});
    } else if (a.kind == SplitKind::kColour) {
      const auto part = [&](std::size_t k) { return static_cast<float>(v[k]) / one; };
      out.colours.push_back({part(0), part(1), part(2), part(3)});
    } else {
      (a.kind == SplitKind::kUv1 ? out.uv1 : out.uv0)
          .push_back({a.grid.value(v[0], 0), a.grid.value(v[1], 1)});
    }
  }
}

}  // namespace

Mesh split_model(const SplitStreamHead& head, const SplitMesh& mesh) {
  Mesh out;
  Numbering points(mesh.points().size()), wedges(mesh.wedge_point().size());
  std::uint16_t parts = 0;
  for (const std::uint32_t f : mesh.visible_faces()) {
    Triangle t;
    for (std::size_t k = 0; k < 3; ++k) t[k] = wedges.of(mesh.wedge_at(f, static_cast<std::uint32_t>(k)));
    const SplitGroup group = head.groups[mesh.face_group()[f]];
    out.triangles.push_back(t);
    out.triangle_material.push_back(group.material);
    out.triangle_part.push_back(group.part);
    parts = std::max(parts, group.part);
  }
  for (const std::uint32_t w : wedges.used()) out.wedge_position.push_back(points.of(mesh.wedge_point()[w]));
  for (const std::uint32_t p : points.used()) {
    const SplitMesh::Point& place = mesh.points()[p];
    out.positions.push_back({head.position.value(place[0], 0), head.position.value(place[1], 1),
                             head.position.value(place[2], 2)});
  }
  for (std::size_t k = 0; k < head.attributes.size(); ++k)
    add_attribute(head.attributes[k], mesh.values(k), wedges.used(), out);
  out.part_names.resize(parts + std::size_t{1});
  return out;
}

}  // namespace texmesh
