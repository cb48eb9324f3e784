#include "stages/simplification/collapse_mesh.h"

#include <map>
#include <numeric>

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

constexpr double kLeastNormalCosine = 0.2;  // between a triangle's normal before and after

Vec3d normal_of_corners(Vec3d a, Vec3d b, Vec3d c) { return cross(b - a, c - a); }

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
  for (std::size_t p = 0; p < n; ++p) point_of_position[p] = point_of_position[input.twin[p]];
  members_ = in_buckets(order.size(), [&](auto&& put) {
    for (std::uint32_t p = 0; p < n; ++p) put(point_of_position[p], p);
  });
  alive_positions_ = static_cast<std::uint32_t>(n);
}

void CollapseMesh::add_faces(const Mesh& mesh, const std::vector<std::uint32_t>& point_of_position) {
  const std::size_t n = mesh.triangles.size();
  const auto point = [&](std::uint32_t t, int k) { return point_of_position[mesh.position_of(t, k)]; };
  face_source_ = in_buckets(points_.size(), [&](auto&& put) {
                   for (std::uint32_t t = 0; t < n; ++t)
                     put(std::min({point(t, 0), point(t, 1), point(t, 2)}), t);
                 }).items;
  faces_.resize(n);
  face_of_source_.resize(n);
  for (std::uint32_t f = 0; f < n; ++f) {
    const std::uint32_t t = face_source_[f];
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
  // Wedges that more than one material uses.
  std::map<std::array<std::uint32_t, 2>, std::uint32_t> others;
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    const std::uint32_t use = mesh.triangle_material[face_source_[f]];
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

std::uint32_t CollapseRing::slot_of(std::uint32_t point) {
  Mark& mark = mark_[point];
  if (mark.stamp != now_) {
    mark = {now_, static_cast<std::uint32_t>(neighbours_.size())};
    neighbours_.emplace_back().point = point;
  }
  return mark.slot;
}

void CollapseRing::gather(std::uint32_t u) {
  ++now_;
  centre_ = u;
  corners_.clear();
  neighbours_.clear();
  wedges_.clear();
  for (std::uint32_t entry : mesh_.corners(u)) {
    const CollapseMesh::Face& face = mesh_.faces()[entry / 4];
    if (!face.alive()) continue;
    const std::uint32_t c = entry % 4, next = c == 2 ? 0 : c + 1, last = c == 0 ? 2 : c - 1;
    auto wedge = static_cast<std::uint32_t>(std::find(wedges_.begin(), wedges_.end(), face.wedge[c]) -
                                            wedges_.begin());
    if (wedge == wedges_.size()) wedges_.push_back(face.wedge[c]);
    const std::uint32_t a = slot_of(face.point[next]), b = slot_of(face.point[last]);
    corners_.push_back({entry / 4, c, a, b, wedge});
    auto meet = [&](std::uint32_t slot, std::uint32_t target) {
      Neighbour& n = neighbours_[slot];
      if (n.valence < kMaxValence) n.pair[n.pairs++] = {wedge, target};
      ++n.valence;
    };
    meet(a, face.wedge[next]);
    meet(b, face.wedge[last]);
  }
  usual_valence_ = kNoIndex;
  for (const Neighbour& n : neighbours_)
    if (n.valence % 2 == 0) usual_valence_ = std::min(usual_valence_, n.valence);
  if (usual_valence_ == kNoIndex) usual_valence_ = 2;
  odd_edges_ = odd_valence_ = 0;
  odd_mixed_ = false;
  for (const Neighbour& n : neighbours_)
    if (n.valence != usual_valence_) {
      odd_mixed_ = odd_mixed_ || (odd_edges_ > 0 && n.valence != odd_valence_);
      odd_valence_ = n.valence;
      ++odd_edges_;
    }
}

bool CollapseRing::map_wedges(std::uint32_t slot, WedgeMap& map) const {
  map.slot = kNone;
  map.target.assign(wedges_.size(), kNone);
  const Neighbour& n = neighbours_[slot];
  std::size_t count = 0;
  for (std::uint32_t i = 0; i < n.pairs; ++i) {
    std::uint32_t& target = map.target[n.pair[i].from];
    if (target == kNone) {
      target = n.pair[i].to;
      ++count;
    } else if (target != n.pair[i].to) {
      return false;
    }
  }
  if (count < wedges_.size() && count < 2 && n.valence == usual_valence_ && !may_touch_) return false;
  if ((mesh_.is_multiple(centre_) || mesh_.is_multiple(n.point)) && !positions_agree(n)) return false;
  map.slot = slot;
  return true;
}

/// Twins: every position of the group must go to one position of the other group.
bool CollapseRing::positions_agree(const Neighbour& n) const {
  for (std::uint32_t position : mesh_.members(centre_)) {
    std::uint32_t to = kNone;
    for (std::uint32_t i = 0; i < n.pairs; ++i) {
      if (mesh_.wedge_position(wedges_[n.pair[i].from]) != position) continue;
      const std::uint32_t target = mesh_.wedge_position(n.pair[i].to);
      if (to != kNone && to != target) return false;
      to = target;
    }
    if (to == kNone && !may_touch_) return false;
  }
  return true;
}

std::uint32_t CollapseRing::destination(const Neighbour& n, std::uint32_t position) const {
  for (std::uint32_t i = 0; i < n.pairs; ++i)
    if (mesh_.wedge_position(wedges_[n.pair[i].from]) == position) return mesh_.wedge_position(n.pair[i].to);
  return may_touch_ ? mesh_.members(n.point)[0] : kNone;
}

bool CollapseRing::keeps_topology(std::uint32_t slot) {
  const std::uint32_t v = neighbours_[slot].point;
  for (Neighbour& n : neighbours_) n.faces = n.far_valence = 0;
  for (const Corner& c : corners_) {
    if (c.a == slot) ++neighbours_[c.b].faces;
    if (c.b == slot) ++neighbours_[c.a].faces;
  }
  bool closes = false;  // a face of v that has both other points in the ring
  for (std::uint32_t entry : mesh_.corners(v)) {
    const CollapseMesh::Face& face = mesh_.faces()[entry / 4];
    if (!face.alive()) continue;
    int met = 0;
    for (std::uint32_t k = 1; k <= 2; ++k) {
      const std::uint32_t x = face.point[(entry % 4 + k) % 3];
      if (x == centre_ || mark_[x].stamp != now_) continue;
      Neighbour& n = neighbours_[mark_[x].slot];
      if (n.faces == 0 && !may_touch_) return false;
      ++n.far_valence;
      ++met;
    }
    closes = closes || met == 2;
  }
  for (const Neighbour& n : neighbours_) {
    if (n.far_valence == 0) continue;
    const std::uint32_t both = n.valence + n.far_valence, left = both - 2 * n.faces;
    const std::uint32_t most = may_touch_ ? kMaxValence : std::max(n.valence, n.far_valence);
    if (left > most || (left < 1 && !(may_touch_ && mesh_.corner_count(n.point) > n.faces))) return false;
  }
  if (!keeps_positions(slot)) return false;
  if (may_touch_) return corners_.size() + mesh_.corner_count(v) > 2 * neighbours_[slot].valence;
  if (!closes) return true;
  for (const Corner& c : corners_) {  // a face of u that would repeat a face of v
    if (c.a == slot || c.b == slot || neighbours_[c.a].faces == 0 || neighbours_[c.b].faces == 0) continue;
    const std::uint32_t a = neighbours_[c.a].point, b = neighbours_[c.b].point;
    for (std::uint32_t entry : mesh_.corners(v)) {
      const CollapseMesh::Face& face = mesh_.faces()[entry / 4];
      if (!face.alive()) continue;
      const std::uint32_t x = face.point[(entry % 4 + 1) % 3], y = face.point[(entry % 4 + 2) % 3];
      if ((x == a && y == b) || (x == b && y == a)) return false;
    }
  }
  return true;
}

/// Twins: no position of the group that stays may lose its last face, or it would be gone without a record.
bool CollapseRing::keeps_positions(std::uint32_t slot) const {
  const Neighbour& n = neighbours_[slot];
  auto vanishes = [&](const CollapseMesh::Face& face) {
    return (face.point[0] == centre_ || face.point[1] == centre_ || face.point[2] == centre_) &&
           (face.point[0] == n.point || face.point[1] == n.point || face.point[2] == n.point);
  };
  auto stays = [&](std::uint32_t point, std::uint32_t position) {
    for (std::uint32_t entry : mesh_.corners(point)) {
      const CollapseMesh::Face& face = mesh_.faces()[entry / 4];
      if (face.alive() && mesh_.wedge_position(face.wedge[entry % 4]) == position && !vanishes(face))
        return true;
    }
    if (point != n.point) return false;
    return std::any_of(corners_.begin(), corners_.end(), [&](const Corner& c) {
      return c.a != slot && c.b != slot && destination(n, mesh_.wedge_position(wedges_[c.wedge])) == position;
    });
  };
  for (const Corner& c : corners_) {
    if (c.a != slot && c.b != slot) continue;
    const CollapseMesh::Face& face = mesh_.faces()[c.face];
    for (std::uint32_t k = 0; k < 3; ++k)
      if (face.point[k] != centre_ && mesh_.is_multiple(face.point[k]) &&
          !stays(face.point[k], mesh_.wedge_position(face.wedge[k])))
        return false;
  }
  return true;
}

/// Texture triangles without area may become anything.
bool CollapseRing::turns_over(const Corner& c, const WedgeMap& map, auto&& uv) const {
  const CollapseMesh::Face& face = mesh_.faces()[c.face];
  const Vec2d a = uv(face.wedge[(c.corner + 1) % 3]), b = uv(face.wedge[(c.corner + 2) % 3]);
  const Vec2d from = uv(wedges_[c.wedge]), to = uv(map.target[c.wedge]);
  const double before = cross(a - from, b - from);
  return before != 0 && !(before * cross(a - to, b - to) > 0);
}

bool CollapseRing::keeps_orientation(const WedgeMap& map) const {
  const std::uint32_t slot = map.slot;
  const Vec3d from = mesh_.point(centre_), to = mesh_.point(neighbours_[slot].point);
  for (const Corner& c : corners_) {
    if (c.a == slot || c.b == slot) continue;
    const Vec3d a = mesh_.point(neighbours_[c.a].point), b = mesh_.point(neighbours_[c.b].point);
    const Vec3d before = normal_of_corners(from, a, b), after = normal_of_corners(to, a, b);
    const double square = dot(before, before) * dot(after, after), along = dot(before, after);
    if (dot(before, before) > 0 &&
        (along <= 0 || along * along <= kLeastNormalCosine * kLeastNormalCosine * square))
      return false;
    if (map.target[c.wedge] == kNone) continue;
    if (mesh_.has_uv() && turns_over(c, map, [&](std::uint32_t w) { return mesh_.wedge_uv(w); }))
      return false;
    if (mesh_.has_other_uv() && turns_over(c, map, [&](std::uint32_t w) { return mesh_.wedge_other_uv(w); }))
      return false;
  }
  return true;
}

}  // namespace texmesh
