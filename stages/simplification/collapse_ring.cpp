#include "stages/simplification/collapse_ring.h"

#include <algorithm>

namespace texmesh {
namespace {

constexpr double kLeastNormalCosine = 0.2;  // between a triangle's normal before and after

Vec3d normal_of_corners(Vec3d a, Vec3d b, Vec3d c) { return cross(b - a, c - a); }

}  // namespace

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
  if (count < wedges_.size() && count < 2 && n.valence == usual_valence_) return false;
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
    if (to == kNone) return false;
  }
  return true;
}

std::uint32_t CollapseRing::destination(const Neighbour& n, std::uint32_t position) const {
  for (std::uint32_t i = 0; i < n.pairs; ++i)
    if (mesh_.wedge_position(wedges_[n.pair[i].from]) == position) return mesh_.wedge_position(n.pair[i].to);
  return kNone;
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
      if (n.faces == 0) return false;
      ++n.far_valence;
      ++met;
    }
    closes = closes || met == 2;
  }
  for (const Neighbour& n : neighbours_) {
    if (n.faces == 0) continue;
    const std::uint32_t both = n.valence + n.far_valence, left = both - 2 * n.faces;
    if (left < 1 || left > std::max(n.valence, n.far_valence)) return false;
  }
  if (!keeps_positions(slot)) return false;
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
