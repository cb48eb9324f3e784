#include "stages/simplification/collapse_mesh.h"

#include <map>
#include <numeric>

#include "format/base/box.h"
#include "stages/geometry/morton.h"

namespace texmesh {
namespace {

/// `p` in the unit-diagonal frame, so every coordinate lies in [-0.5, 0.5].
std::uint64_t curve_code(Vec3d p) {
  auto cell = [](double x) {
    return static_cast<std::uint32_t>(std::clamp((x + 0.5) * 2097151.0, 0.0, 2097151.0));
  };
  return morton_code(cell(p.x), cell(p.y), cell(p.z));
}

}  // namespace

CollapseMesh::CollapseMesh(const ConditionedMesh& input) {
  std::vector<std::uint32_t> point_of_position;
  number_points(input, point_of_position);
  add_faces(input.mesh, point_of_position);
  number_wedges(input.mesh);
  copy_uvs(input);
  build_lists();
  left_.resize(input.mesh.triangles.size());
  std::iota(left_.begin(), left_.end(), 0u);
}

void CollapseMesh::number_points(const ConditionedMesh& input,
                                 std::vector<std::uint32_t>& point_of_position) {
  const std::vector<Vec3f>& positions = input.mesh.positions;
  const std::size_t n = positions.size();
  const Box3d box = to_double(bounding_box(positions));
  diagonal_ = box.diagonal() > 0 ? box.diagonal() : 1;
  const Vec3d centre = box.centre();
  auto local = [&](std::size_t p) { return (to_double(positions[p]) - centre) * (1 / diagonal_); };

  std::vector<std::pair<std::uint64_t, std::uint32_t>> order;  // code, position; one per group of twins
  for (std::size_t p = 0; p < n; ++p)
    if (input.twin[p] == p) order.emplace_back(curve_code(local(p)), static_cast<std::uint32_t>(p));
  std::sort(order.begin(), order.end());

  point_of_position.assign(n, kNoIndex);
  points_.resize(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    points_[i] = local(order[i].second);
    point_of_position[order[i].second] = static_cast<std::uint32_t>(i);
  }
  member_begin_.assign(order.size() + 1, 0);
  for (std::size_t p = 0; p < n; ++p) {
    point_of_position[p] = point_of_position[input.twin[p]];
    ++member_begin_[point_of_position[p] + 1];
  }
  std::partial_sum(member_begin_.begin(), member_begin_.end(), member_begin_.begin());
  members_.resize(n);
  std::vector<std::uint32_t> at(member_begin_.begin(), member_begin_.end() - 1);
  for (std::size_t p = 0; p < n; ++p) members_[at[point_of_position[p]]++] = static_cast<std::uint32_t>(p);
  alive_positions_ = static_cast<std::uint32_t>(n);
}

void CollapseMesh::add_faces(const Mesh& mesh, const std::vector<std::uint32_t>& point_of_position) {
  const std::size_t n = mesh.triangles.size();
  std::vector<std::uint32_t> first(points_.size() + 1, 0), key(n);
  for (std::size_t t = 0; t < n; ++t) {
    const auto i = static_cast<std::uint32_t>(t);
    key[t] = std::min({point_of_position[mesh.position_of(i, 0)], point_of_position[mesh.position_of(i, 1)],
                       point_of_position[mesh.position_of(i, 2)]});
    ++first[key[t] + 1];
  }
  std::partial_sum(first.begin(), first.end(), first.begin());
  faces_.resize(n);
  face_source_.resize(n);
  face_of_source_.resize(n);
  for (std::size_t t = 0; t < n; ++t) {
    const std::uint32_t f = first[key[t]]++;
    face_source_[f] = static_cast<std::uint32_t>(t);
    face_of_source_[t] = f;
    for (std::size_t k = 0; k < 3; ++k) {
      faces_[f].wedge[k] = mesh.triangles[t][k];
      faces_[f].point[k] = point_of_position[mesh.wedge_position[mesh.triangles[t][k]]];
    }
  }
  alive_faces_ = static_cast<std::uint32_t>(n);
}

void CollapseMesh::number_wedges(const Mesh& mesh) {
  input_wedges_ = static_cast<std::uint32_t>(mesh.wedge_count());
  std::vector<std::uint32_t> first(input_wedges_, kNoIndex), group(input_wedges_, 0);
  // Wedges that more than one material or part uses.
  std::map<std::array<std::uint32_t, 2>, std::uint32_t> others;
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    const std::size_t t = face_source_[f];
    const std::uint32_t use = std::uint32_t{mesh.triangle_material[t]} << 16 | mesh.triangle_part[t];
    for (std::uint32_t& wedge : faces_[f].wedge) {
      const std::uint32_t real = wedge;
      std::uint32_t id = kNoIndex;
      if (first[real] == kNoIndex) {
        id = first[real] = wedge_count();
        group[real] = use;
      } else if (group[real] == use) {
        id = first[real];
      } else {
        id = others.try_emplace({real, use}, wedge_count()).first->second;
      }
      if (id == wedge_count()) {
        wedge_real_.push_back(real);
        wedge_source_.push_back(real);
        wedge_position_.push_back(mesh.wedge_position[real]);
      }
      wedge = id;
    }
  }
}

void CollapseMesh::copy_uvs(const ConditionedMesh& input) {
  const Mesh& mesh = input.mesh;
  const std::vector<Vec2f>* sets[2] = {&mesh.uv0, &mesh.uv1};
  if (mesh.uv0.empty() && (mesh.uv1.empty() || input.uv_sets.empty())) return;
  const bool two = !mesh.uv0.empty() && !mesh.uv1.empty();
  const auto both = [](const UvSets& s) { return s.both != 0; };
  wedge_uv_.resize(wedge_count());
  if (two && std::any_of(input.uv_sets.begin(), input.uv_sets.end(), both))
    wedge_other_uv_.resize(wedge_count());
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    const std::size_t material = mesh.triangle_material[face_source_[f]];
    const UvSets use = material < input.uv_sets.size() ? input.uv_sets[material] : UvSets{};
    const std::vector<Vec2f>&guide = *sets[use.guide], &other = *sets[1 - use.guide];
    for (std::uint32_t w : faces_[f].wedge) {
      if (!guide.empty()) wedge_uv_[w] = guide[wedge_source_[w]];
      if (use.both && !wedge_other_uv_.empty()) wedge_other_uv_[w] = other[wedge_source_[w]];
    }
  }
}

void CollapseMesh::build_lists() {
  lists_.assign(points_.size(), {});
  for (const Face& face : faces_)
    for (std::uint32_t p : face.point) ++lists_[p].capacity;
  std::uint32_t at = 0;
  for (List& list : lists_) {
    list.begin = at;
    at += list.capacity;
  }
  pool_.resize(at);
  for (std::size_t f = 0; f < faces_.size(); ++f)
    for (std::uint32_t k = 0; k < 3; ++k) {
      List& list = lists_[faces_[f].point[k]];
      pool_[list.begin + list.count++] = static_cast<std::uint32_t>(f) * 4 + k;
    }
}

std::uint32_t CollapseMesh::add_wedge(std::uint32_t wedge, std::uint32_t position) {
  const std::uint32_t source = wedge_source_[wedge];
  new_wedges_.push_back({source, position});
  wedge_real_.push_back(input_wedges_ + static_cast<std::uint32_t>(new_wedges_.size() - 1));
  wedge_source_.push_back(source);
  wedge_position_.push_back(position);
  for (std::vector<Vec2f>* uv : {&wedge_uv_, &wedge_other_uv_}) {
    if (uv->empty()) continue;
    const Vec2f same = (*uv)[wedge];
    uv->push_back(same);
  }
  return wedge_count() - 1;
}

void CollapseMesh::remove_face(std::uint32_t face, std::uint32_t except_point) {
  faces_[face].wedge[0] = kNoIndex;
  --alive_faces_;
  for (std::uint32_t k = 0; k < 3; ++k) {
    const std::uint32_t p = faces_[face].point[k];
    if (p == except_point) continue;
    List& list = lists_[p];
    if (list.count > kLongList) {
      // A search through the list of a hub for every face it loses would take quadratic time.
      if (++list.dead * 2 >= list.count) drop_dead(list);
      continue;
    }
    std::uint32_t* begin = pool_.data() + list.begin;
    std::uint32_t* last = std::remove(begin, begin + list.count, face * 4 + k);
    list.count = static_cast<std::uint32_t>(last - begin);
  }
}

void CollapseMesh::drop_dead(List& list) {
  std::uint32_t* begin = pool_.data() + list.begin;
  std::uint32_t* last =
      std::remove_if(begin, begin + list.count, [&](std::uint32_t e) { return !faces_[e / 4].alive(); });
  list.count = static_cast<std::uint32_t>(last - begin);
  list.dead = 0;
}

void CollapseMesh::remove(std::span<const std::uint32_t> points) {
  for (std::uint32_t p : points) {
    if (!is_alive(p)) continue;
    List& list = lists_[p];
    for (std::uint32_t i = 0; i < list.count; ++i) {
      Face& face = faces_[pool_[list.begin + i] / 4];
      if (!face.alive()) continue;
      face.wedge[0] = kNoIndex;
      --alive_faces_;
    }
  }
  for (std::uint32_t p : points) {
    if (lists_[p].count == lists_[p].dead) continue;
    lists_[p].count = lists_[p].dead = 0;
    alive_positions_ -= static_cast<std::uint32_t>(members(p).size());
  }
}

void CollapseMesh::append(std::uint32_t to) {
  List& list = lists_[to];
  const auto more = static_cast<std::uint32_t>(moved_.size());
  if (list.count + more > list.capacity) {
    const auto begin = static_cast<std::uint32_t>(pool_.size());
    const std::uint32_t capacity = list.count + more + list.count / 2 + 4;
    pool_.resize(pool_.size() + capacity);
    std::copy_n(pool_.begin() + list.begin, list.count, pool_.begin() + begin);
    list = {begin, list.count, capacity, list.dead};
  }
  std::copy(moved_.begin(), moved_.end(), pool_.begin() + list.begin + list.count);
  list.count += more;
}

void CollapseMesh::snapshot(std::vector<Triangle>& triangles, std::vector<std::uint32_t>& source) {
  std::erase_if(left_, [&](std::uint32_t t) { return !faces_[face_of_source_[t]].alive(); });
  source = left_;
  triangles.resize(left_.size());
  for (std::size_t i = 0; i < left_.size(); ++i) {
    const Face& face = faces_[face_of_source_[left_[i]]];
    triangles[i] = {wedge_real_[face.wedge[0]], wedge_real_[face.wedge[1]], wedge_real_[face.wedge[2]]};
  }
}

}  // namespace texmesh
