#include "format/split/split_mesh.h"
#include "format/base/no_index.h"

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

std::uint32_t SplitMesh::add_point() {
  points_.push_back({});
  head_.push_back(kNoIndex);
  degree_.push_back(0);
  first_a_.push_back(kNoIndex);
  count_b_.push_back(0);
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
  faces_.push_back(wedges);
  face_group_.push_back(group);
  for (std::uint32_t k = 0; k < 3; ++k) {
    const std::uint32_t p = wedge_point_[wedges[k]];
    next_.push_back(head_[p]);
    head_[p] = 3 * face + k;
    ++degree_[p];
  }
  return face;
}

void SplitMesh::distribute(std::uint32_t from, std::uint32_t to, const std::vector<Corner>& corners) {
  head_[from] = head_[to] = kNoIndex;
  degree_[from] = degree_[to] = 0;
  for (std::size_t i = corners.size(); i-- > 0;) {
    const Corner& c = corners[i];
    const std::uint32_t id = 3 * c.face + c.corner, p = c.moves ? to : from;
    if (c.moves) faces_[c.face][c.corner] = c.target;
    next_[id] = head_[p];
    head_[p] = id;
    ++degree_[p];
  }
}

/// Appends the fan that begins with the loose corner `start`.
void SplitMesh::gather_fan(std::uint32_t start, std::vector<Corner>& corners, std::vector<Fan>& fans) {
  Fan fan{static_cast<std::uint32_t>(corners.size()), 0, false};
  for (std::uint32_t at = start; at != kNoIndex;) {
    taken_[at] = true;
    corners.push_back(loose_[at]);
    std::uint32_t& next = first_a_[loose_[at].b];
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
    chain_[i] = first_a_[loose_[i].a];
    first_a_[loose_[i].a] = static_cast<std::uint32_t>(i);
    ++count_b_[loose_[i].b];
  }
  for (std::uint32_t i = 0; i < loose_.size(); ++i)
    if (!taken_[i] && count_b_[loose_[i].a] == 0) gather_fan(i, corners, fans);
  for (std::uint32_t i = 0; i < loose_.size(); ++i)
    if (!taken_[i]) gather_fan(i, corners, fans);
  for (const Corner& c : loose_) first_a_[c.a] = kNoIndex, count_b_[c.b] = 0;
}

}  // namespace texmesh
