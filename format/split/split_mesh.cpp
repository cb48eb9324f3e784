#include "format/split/split_mesh.h"

namespace texmesh {

SplitMesh::SplitMesh(std::vector<int> components)
    : components_(std::move(components)), values_(components_.size()) {}

std::vector<std::uint32_t> SplitMesh::visible_faces() const {
  std::vector<std::uint32_t> visible;
  for (std::uint32_t f = 0; f < faces_.size(); ++f) {
    const Point &a = points_[point_at(f, 0)], &b = points_[point_at(f, 1)], &c = points_[point_at(f, 2)];
    if (a != b && b != c && c != a) visible.push_back(f);
  }
  return visible;
}

void SplitMesh::reserve(std::size_t points, std::size_t wedges, std::size_t faces) {
  points_.reserve(points);
  ring_.reserve(points);
  wedge_point_.reserve(wedges);
  for (std::size_t k = 0; k < values_.size(); ++k)
    values_[k].reserve(wedges * static_cast<std::size_t>(components_[k]));
  faces_.reserve(faces);
  face_group_.reserve(faces);
}

std::uint32_t SplitMesh::add_point() {
  points_.push_back({});
  ring_.emplace_back();
  return static_cast<std::uint32_t>(points_.size() - 1);
}

std::uint32_t SplitMesh::add_wedge(std::uint32_t point) {
  wedge_point_.push_back(point);
  for (std::size_t k = 0; k < values_.size(); ++k)
    values_[k].resize(values_[k].size() + static_cast<std::size_t>(components_[k]), 0);
  return static_cast<std::uint32_t>(wedge_point_.size() - 1);
}

void SplitMesh::copy_values(std::uint32_t from, std::uint32_t to) {
  for (std::size_t k = 0; k < values_.size(); ++k)
    for (int i = 0; i < components_[k]; ++i) value(k, to)[i] = value(k, from)[i];
}

std::uint32_t SplitMesh::add_face(std::array<std::uint32_t, 3> wedges, std::uint16_t group) {
  const auto face = static_cast<std::uint32_t>(faces_.size());
  Face& added = faces_.emplace_back(Face{wedges, {}, {}});
  face_group_.push_back(group);
  for (std::uint32_t k = 0; k < 3; ++k) {
    Ring& ring = ring_[added.point[k] = wedge_point_[wedges[k]]];
    added.next[k] = ring.head;
    ring.head = 3 * face + k;
    ++ring.degree;
  }
  return face;
}

void SplitMesh::distribute(std::uint32_t from, std::uint32_t to, const std::vector<Corner>& corners) {
  for (const std::uint32_t p : {from, to}) ring_[p].head = kNoIndex, ring_[p].degree = 0;
  for (std::size_t i = corners.size(); i-- > 0;) {
    const Corner& c = corners[i];
    Ring& ring = ring_[c.moves ? to : from];
    Face& face = faces_[c.face];
    if (c.moves) face.wedge[c.corner] = c.target, face.point[c.corner] = to;
    face.next[c.corner] = ring.head;
    ring.head = 3 * c.face + c.corner;
    ++ring.degree;
  }
}

std::uint32_t SplitMesh::look_beside(std::uint32_t corner) const {
  const std::uint32_t face = corner / 3, beside = point_at(face, corner + 1);
  const std::size_t wedge = wedge_at(face, corner + 1);
  ask_memory(&ring_[beside]);
  ask_memory(&points_[beside]);
  for (std::size_t k = 0; k < values_.size(); ++k)
    ask_memory(values_[k].data() + wedge * static_cast<std::size_t>(components_[k]));
  return asked_for(next_of(corner));
}

/// Appends the fan that begins with the loose corner `start`.
void SplitMesh::gather_fan(std::uint32_t start, std::vector<Corner>& corners, std::vector<Fan>& fans) {
  Fan fan{static_cast<std::uint32_t>(corners.size()), 0, false};
  for (std::uint32_t at = start; at != kNoIndex;) {
    taken_[at] = true;
    corners.push_back(loose_[at]);
    std::uint32_t& next = ring_[loose_[at].b].first_a;
    while (next != kNoIndex && taken_[next]) next = chain_[next];
    at = next;
  }
  fan.end = static_cast<std::uint32_t>(corners.size());
  fan.closed = corners[fan.begin].a == corners[fan.end - 1].b;
  fans.push_back(fan);
}

void SplitMesh::gather(std::uint32_t point, std::vector<Corner>& corners, std::vector<Fan>& fans) {
  corners.clear();
  fans.clear();
  loose_.clear();
  each_corner(point, [&](std::uint32_t face, std::uint32_t corner) {
    loose_.push_back({face, corner, point_at(face, corner + 1), point_at(face, corner + 2),
                      wedge_at(face, corner), false, kNoIndex});
  });
  chain_.assign(loose_.size(), kNoIndex);
  taken_.assign(loose_.size(), false);
  for (std::size_t i = loose_.size(); i-- > 0;) {
    std::uint32_t& first = ring_[loose_[i].a].first_a;
    chain_[i] = first;
    first = static_cast<std::uint32_t>(i);
    ++ring_[loose_[i].b].count_b;
  }
  for (std::uint32_t i = 0; i < loose_.size(); ++i)
    if (!taken_[i] && ring_[loose_[i].a].count_b == 0) gather_fan(i, corners, fans);
  for (std::uint32_t i = 0; i < loose_.size(); ++i)
    if (!taken_[i]) gather_fan(i, corners, fans);
  for (const Corner& c : loose_) ring_[c.a].first_a = kNoIndex, ring_[c.b].count_b = 0;
}

}  // namespace texmesh
