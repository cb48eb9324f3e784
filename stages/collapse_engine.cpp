#include "stages/collapse_engine.h"

#include <algorithm>
#include <cmath>

namespace texmesh {
namespace {

constexpr double kLeastNormalCosine = 0.2;  // between a triangle's normal before and after
constexpr double kFadeBelow = 0.02;  // of the vertices: there the attributes' weight starts to fall to 0
// A little of the moved distance keeps flat places, where every collapse is free, from growing slivers.
constexpr double kDistanceWeight = 1e-6;

Vec3d face_normal(Vec3d a, Vec3d b, Vec3d c) { return cross(b - a, c - a); }

}  // namespace

void CollapseQueue::set(std::uint32_t p, double key) {
  if (at_[p] == kOut) {
    at_[p] = static_cast<std::uint32_t>(heap_.size());
    heap_.push_back(p);
    key_[p] = key;
    sift_up(at_[p]);
    return;
  }
  const double old = key_[p];
  key_[p] = key;
  if (key < old)
    sift_up(at_[p]);
  else if (key > old)
    sift_down(at_[p]);
}

void CollapseQueue::erase(std::uint32_t p) {
  const std::uint32_t i = at_[p];
  if (i == kOut) return;
  at_[p] = kOut;
  const std::uint32_t last = heap_.back();
  heap_.pop_back();
  if (last == p) return;
  heap_[i] = last;
  at_[last] = i;
  sift_up(i);
  sift_down(at_[last]);
}

void CollapseQueue::sift_up(std::size_t i) {
  const std::uint32_t p = heap_[i];
  while (i > 0 && before(p, heap_[(i - 1) / 4])) {
    heap_[i] = heap_[(i - 1) / 4];
    at_[heap_[i]] = static_cast<std::uint32_t>(i);
    i = (i - 1) / 4;
  }
  heap_[i] = p;
  at_[p] = static_cast<std::uint32_t>(i);
}

void CollapseQueue::sift_down(std::size_t i) {
  const std::uint32_t p = heap_[i];
  for (;;) {
    std::size_t least = 4 * i + 1;
    if (least >= heap_.size()) break;
    const std::size_t end = std::min(least + 4, heap_.size());
    for (std::size_t c = least + 1; c < end; ++c)
      if (before(heap_[c], heap_[least])) least = c;
    if (!before(heap_[least], p)) break;
    heap_[i] = heap_[least];
    at_[heap_[i]] = static_cast<std::uint32_t>(i);
    i = least;
  }
  heap_[i] = p;
  at_[p] = static_cast<std::uint32_t>(i);
}

CollapseEngine::CollapseEngine(const ConditionedMesh& input, const ScaleMap& scale_map,
                               const SimplificationOptions& options)
    : input_(input.mesh), options_(options), mesh_(input), queue_(mesh_.point_count()) {
  initial_positions_ = mesh_.alive_positions();
  stamp_.assign(mesh_.point_count(), 0);
  slot_.assign(mesh_.point_count(), 0);
  persistence_.assign(mesh_.point_count(), 0);
  for (std::uint32_t p = 0; p < mesh_.point_count(); ++p)
    for (std::uint32_t position : mesh_.members(p))
      persistence_[p] = std::max(persistence_[p], scale_map.persistence[position]);
  add_shape_quadrics();
  add_border_quadrics();
  add_attribute_quadrics(input.mesh);
  for (std::uint32_t p = 0; p < mesh_.point_count(); ++p)
    if (mesh_.is_alive(p)) refresh(p);
}

void CollapseEngine::add_shape_quadrics() {
  quadric_.resize(mesh_.point_count());
  for (const CollapseMesh::Face& face : mesh_.faces()) {
    const Vec3d a = mesh_.point(face.point[0]);
    const Vec3d n = face_normal(a, mesh_.point(face.point[1]), mesh_.point(face.point[2]));
    const double area = length(n) / 2;
    if (!(area > 0)) continue;
    const Vec3d unit = n * (0.5 / area);
    for (std::uint32_t p : face.point) quadric_[p].add_plane(unit, -dot(unit, a), area);
  }
}

/// Planes that stand on open borders and on borders of materials and parts, so that their lines stay where
/// they are.
void CollapseEngine::add_border_quadrics() {
  for (std::uint32_t u = 0; u < mesh_.point_count(); ++u) {
    gather(u);
    for (const Corner& corner : corners_) {
      const Neighbour& n = neighbours_[corner.a];  // every edge of a face once: from u to the next corner
      const CollapseMesh::Face& face = mesh_.faces()[corner.face];
      const std::uint32_t t = mesh_.face_source(corner.face);
      bool use_border = false;
      for (const Corner& other : corners_)
        if (other.b == corner.a) {
          const std::uint32_t s = mesh_.face_source(other.face);
          use_border = use_border || input_.triangle_material[s] != input_.triangle_material[t] ||
                       input_.triangle_part[s] != input_.triangle_part[t];
        }
      if (n.valence == 2 && !use_border) continue;
      const Vec3d a = mesh_.point(u), edge = mesh_.point(n.point) - a;
      const Vec3d normal =
          face_normal(mesh_.point(face.point[0]), mesh_.point(face.point[1]), mesh_.point(face.point[2]));
      const Vec3d across = normalized(cross(edge, normal));
      const double weight = options_.boundary_weight * dot(edge, edge);
      if (!(weight > 0) || across == Vec3d{}) continue;
      quadric_[u].add_plane(across, -dot(across, a), weight);
      quadric_[n.point].add_plane(across, -dot(across, a), weight);
    }
  }
}

/// Per material: how long one unit of UV is on the surface (in the unit-diagonal frame), so that the
/// texture's distortion is a length like the shape's.
std::vector<double> CollapseEngine::attribute_scales(const Mesh& mesh) const {
  std::vector<double> surface, texture, scale;
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) {
    const CollapseMesh::Face& face = mesh_.faces()[f];
    const std::size_t material = mesh.triangle_material[mesh_.face_source(f)];
    if (material >= surface.size()) surface.resize(material + 1), texture.resize(material + 1);
    surface[material] += length(
        face_normal(mesh_.point(face.point[0]), mesh_.point(face.point[1]), mesh_.point(face.point[2])));
    const Vec2d a = to_double(mesh.uv0[mesh_.wedge_source(face.wedge[0])]);
    texture[material] += std::fabs(cross(to_double(mesh.uv0[mesh_.wedge_source(face.wedge[1])]) - a,
                                         to_double(mesh.uv0[mesh_.wedge_source(face.wedge[2])]) - a));
  }
  for (std::size_t m = 0; m < surface.size(); ++m)
    scale.push_back(texture[m] > 0 ? std::sqrt(surface[m] / texture[m]) : 0);
  return scale;
}

void CollapseEngine::add_attribute_quadrics(const Mesh& mesh) {
  // Colours guide the collapse only where nothing else carries the look; a full step of a channel then counts
  // as much as a shift by a twentieth of the diagonal.
  constexpr double kColourLength = 0.05;
  const bool uv = !mesh.uv0.empty(), colour = !uv && !mesh.colours.empty();
  channels_ = options_.uv_weight > 0 && options_.order != CollapseOrder::kThesis ? (uv       ? 2
                                                                                    : colour ? 3
                                                                                             : 0)
                                                                                 : 0;
  attribute_quadric_ = AttributeQuadrics(channels_);
  if (channels_ == 0) return;
  attribute_.assign(mesh_.wedge_count() * channels_, 0);
  attribute_quadric_.resize(mesh_.wedge_count());
  const std::vector<double> scale = uv ? attribute_scales(mesh) : std::vector<double>{};
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) {
    const CollapseMesh::Face& face = mesh_.faces()[f];
    for (std::uint32_t w : face.wedge) {
      double* at = attribute_.data() + w * channels_;
      if (uv) {
        const double s = scale[mesh.triangle_material[mesh_.face_source(f)]];
        const Vec2f value = mesh.uv0[mesh_.wedge_source(w)];
        at[0] = s * value.x, at[1] = s * value.y;
      } else {
        const Vec4f c = mesh.colours[mesh_.wedge_source(w)];
        at[0] = kColourLength * c.x, at[1] = kColourLength * c.y, at[2] = kColourLength * c.z;
      }
    }
    const Vec3d p0 = mesh_.point(face.point[0]);
    const Vec3d e1 = mesh_.point(face.point[1]) - p0, e2 = mesh_.point(face.point[2]) - p0;
    const Vec3d n = cross(e1, e2);
    const double square = dot(n, n);
    if (!(square > 0)) continue;
    double area = std::sqrt(square) / 2;
    const Vec3d along1 = cross(e2, n) * (1 / square), along2 = cross(n, e1) * (1 / square);
    std::array<Vec3d, 3> gradient;
    double steepest = 0;
    for (std::size_t k = 0; k < channels_; ++k) {
      const double s0 = attributes(face.wedge[0])[k];
      gradient[k] =
          along1 * (attributes(face.wedge[1])[k] - s0) + along2 * (attributes(face.wedge[2])[k] - s0);
      steepest = std::max(steepest, dot(gradient[k], gradient[k]));
    }
    // Where charts are folded to slivers the gradient runs away; its weight must not.
    if (steepest > 64) area *= 64 / steepest;
    for (std::uint32_t w : face.wedge) {
      for (std::size_t k = 0; k < channels_; ++k)
        attribute_quadric_.add_channel(w, k, gradient[k], attributes(face.wedge[0])[k] - dot(gradient[k], p0),
                                       area);
      attribute_quadric_.add_area(w, area);
    }
  }
}

std::uint32_t CollapseEngine::slot_of(std::uint32_t point) {
  if (stamp_[point] != now_) {
    stamp_[point] = now_;
    slot_[point] = static_cast<std::uint32_t>(neighbours_.size());
    neighbours_.emplace_back().point = point;
  }
  return slot_[point];
}

/// Fills corners_, neighbours_ and ring_wedges_ for a point, and counts its odd edges: those that are not
/// inside a surface of two faces per edge (or of four where two sheets lie on each other).
void CollapseEngine::gather(std::uint32_t u) {
  ++now_;
  corners_.clear();
  neighbours_.clear();
  ring_wedges_.clear();
  for (std::uint32_t entry : mesh_.corners(u)) {
    const CollapseMesh::Face& face = mesh_.faces()[entry / 4];
    const std::uint32_t c = entry % 4, next = (c + 1) % 3, last = (c + 2) % 3;
    auto wedge = static_cast<std::uint32_t>(
        std::find(ring_wedges_.begin(), ring_wedges_.end(), face.wedge[c]) - ring_wedges_.begin());
    if (wedge == ring_wedges_.size()) ring_wedges_.push_back(face.wedge[c]);
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
  usual_valence_ = 0xffffffffu;
  for (const Neighbour& n : neighbours_)
    if (n.valence % 2 == 0) usual_valence_ = std::min(usual_valence_, n.valence);
  if (usual_valence_ == 0xffffffffu) usual_valence_ = 2;
  odd_edges_ = odd_valence_ = 0;
  odd_mixed_ = false;
  for (const Neighbour& n : neighbours_)
    if (n.valence != usual_valence_) {
      odd_mixed_ = odd_mixed_ || (odd_edges_ > 0 && n.valence != odd_valence_);
      odd_valence_ = n.valence;
      ++odd_edges_;
    }
}

/// Borders and non-manifold lines shrink along themselves only; where they end, meet or change they stay.
bool CollapseEngine::allowed_by_borders(const Neighbour& n) const {
  if (n.valence > kMaxValence) return false;
  if (odd_edges_ == 0) return true;
  return odd_edges_ == 2 && !odd_mixed_ && n.valence == odd_valence_;
}

/// Sets target_ from the faces that the collapse removes. Every wedge must be mapped, to one wedge. A
/// junction of charts may move along a seam or border all the same: the wedges of the charts that are not
/// beside the edge then keep their attributes.
bool CollapseEngine::map_wedges(std::uint32_t u, const Neighbour& n) {
  target_.assign(ring_wedges_.size(), kNone);
  std::size_t mapped = 0;
  for (std::uint32_t i = 0; i < n.pairs; ++i) {
    std::uint32_t& target = target_[n.pair[i].from];
    if (target == kNone) {
      target = n.pair[i].to;
      ++mapped;
    } else if (target != n.pair[i].to) {
      return false;
    }
  }
  if (mapped < ring_wedges_.size() && mapped < 2 && n.valence == usual_valence_) return false;
  return (!mesh_.is_multiple(u) && !mesh_.is_multiple(n.point)) || positions_agree(u, n);
}

/// Twins: every position of the group must go to one position of the other group.
bool CollapseEngine::positions_agree(std::uint32_t u, const Neighbour& n) const {
  for (std::uint32_t position : mesh_.members(u)) {
    std::uint32_t to = kNone;
    for (std::uint32_t i = 0; i < n.pairs; ++i) {
      if (mesh_.wedge_position(ring_wedges_[n.pair[i].from]) != position) continue;
      const std::uint32_t target = mesh_.wedge_position(n.pair[i].to);
      if (to != kNone && to != target) return false;
      to = target;
    }
    if (to == kNone) return false;
  }
  return true;
}

/// Cost (what orders) and error (in the unit-diagonal frame) of merging u into n.
void CollapseEngine::price(std::uint32_t u, Neighbour& n) {
  const Vec3d p = mesh_.point(n.point), moved = p - mesh_.point(u);
  const Quadric& q = quadric_[u];
  const double shape = q.at(p);
  n.error = q.weight > 0 ? std::sqrt(shape / q.weight) : 0;
  if (options_.order == CollapseOrder::kThesis) {
    n.cost = dot(moved, moved);
    return;
  }
  double distortion = 0;
  if (channels_ > 0)
    for (std::size_t w = 0; w < ring_wedges_.size(); ++w)
      distortion += attribute_quadric_.at(ring_wedges_[w], p,
                                          attributes(target_[w] == kNone ? ring_wedges_[w] : target_[w]));
  const double weight =
      options_.order == CollapseOrder::kQem ? 0 : options_.persistence_weight * persistence_[u];
  n.cost =
      (shape + options_.uv_weight * fade_ * distortion + kDistanceWeight * q.weight * dot(moved, moved)) *
      (1 + weight);
}

/// The link condition on the welded surface, twins as one: no new non-manifold edge, no new hole, nothing
/// vanishes.
bool CollapseEngine::keeps_topology(std::uint32_t u, std::uint32_t slot) {
  const std::uint32_t v = neighbours_[slot].point;
  for (Neighbour& n : neighbours_) n.faces = n.far_valence = 0;
  for (const Corner& c : corners_) {
    if (c.a == slot) ++neighbours_[c.b].faces;
    if (c.b == slot) ++neighbours_[c.a].faces;
  }
  for (std::uint32_t entry : mesh_.corners(v)) {
    const CollapseMesh::Face& face = mesh_.faces()[entry / 4];
    for (std::uint32_t k = 1; k <= 2; ++k) {
      const std::uint32_t x = face.point[(entry % 4 + k) % 3];
      if (x == u || stamp_[x] != now_) continue;
      Neighbour& n = neighbours_[slot_[x]];
      if (n.faces == 0) return false;
      ++n.far_valence;
    }
  }
  for (const Neighbour& n : neighbours_) {
    if (n.faces == 0) continue;
    const std::uint32_t both = n.valence + n.far_valence, left = both - 2 * n.faces;
    if (left < 1 || left > std::max(n.valence, n.far_valence)) return false;
  }
  for (const Corner& c : corners_) {  // a face of u that would repeat a face of v
    if (c.a == slot || c.b == slot || neighbours_[c.a].faces == 0 || neighbours_[c.b].faces == 0) continue;
    const std::uint32_t a = neighbours_[c.a].point, b = neighbours_[c.b].point;
    for (std::uint32_t entry : mesh_.corners(v)) {
      const CollapseMesh::Face& face = mesh_.faces()[entry / 4];
      const std::uint32_t x = face.point[(entry % 4 + 1) % 3], y = face.point[(entry % 4 + 2) % 3];
      if ((x == a && y == b) || (x == b && y == a)) return false;
    }
  }
  return true;
}

/// No face turns by more than about 78 degrees or loses its area, and no texture triangle turns over.
bool CollapseEngine::keeps_orientation(std::uint32_t u, std::uint32_t slot) const {
  const Vec3d from = mesh_.point(u), to = mesh_.point(neighbours_[slot].point);
  for (const Corner& c : corners_) {
    if (c.a == slot || c.b == slot) continue;
    const Vec3d a = mesh_.point(neighbours_[c.a].point), b = mesh_.point(neighbours_[c.b].point);
    const Vec3d before = face_normal(from, a, b), after = face_normal(to, a, b);
    const double square = dot(before, before) * dot(after, after), along = dot(before, after);
    if (dot(before, before) > 0 &&
        (along <= 0 || along * along <= kLeastNormalCosine * kLeastNormalCosine * square))
      return false;
    if (input_.uv0.empty() || target_[c.wedge] == kNone) continue;
    const CollapseMesh::Face& face = mesh_.faces()[c.face];
    auto uv = [&](std::uint32_t wedge) { return to_double(input_.uv0[mesh_.wedge_source(wedge)]); };
    const Vec2d ua = uv(face.wedge[(c.corner + 1) % 3]), ub = uv(face.wedge[(c.corner + 2) % 3]);
    const double old_turn = cross(ua - uv(ring_wedges_[c.wedge]), ub - uv(ring_wedges_[c.wedge]));
    const double new_turn = cross(ua - uv(target_[c.wedge]), ub - uv(target_[c.wedge]));
    if (old_turn != 0 && !(old_turn * new_turn > 0)) return false;
  }
  return true;
}

/// The cheapest collapse of u that is allowed; target_ holds its wedge map afterwards.
CollapseEngine::Best CollapseEngine::evaluate(std::uint32_t u) {
  gather(u);
  Best best;
  order_.clear();
  for (std::uint32_t slot = 0; slot < neighbours_.size(); ++slot) {
    Neighbour& n = neighbours_[slot];
    if (!allowed_by_borders(n) || !map_wedges(u, n)) continue;
    price(u, n);
    if (n.error > options_.max_error)
      best.too_far = true;
    else
      order_.push_back(slot);
  }
  std::sort(order_.begin(), order_.end(), [&](std::uint32_t x, std::uint32_t y) {
    const Neighbour &a = neighbours_[x], &b = neighbours_[y];
    return a.cost < b.cost || (a.cost == b.cost && a.point < b.point);
  });
  for (std::uint32_t slot : order_) {
    if (!keeps_topology(u, slot)) continue;
    map_wedges(u, neighbours_[slot]);
    if (!keeps_orientation(u, slot)) continue;
    best.found = true;
    best.slot = slot;
    best.key = options_.order == CollapseOrder::kThesis ? persistence_[u] : neighbours_[slot].cost;
    return best;
  }
  return best;
}

void CollapseEngine::refresh(std::uint32_t p) {
  const Best best = evaluate(p);
  if (best.found)
    queue_.set(p, best.key);
  else
    queue_.erase(p);
  some_too_far_ = some_too_far_ || (best.too_far && !best.found);
}

void CollapseEngine::apply(std::uint32_t u, const Neighbour& n) {
  const std::uint32_t v = n.point;
  const auto error = static_cast<float>(n.error * mesh_.diagonal());
  auto destination = [&](std::uint32_t position) {
    for (std::uint32_t i = 0; i < n.pairs; ++i)
      if (mesh_.wedge_position(ring_wedges_[n.pair[i].from]) == position)
        return mesh_.wedge_position(n.pair[i].to);
    return kNone;
  };
  for (std::uint32_t position : mesh_.members(u))
    collapses_.push_back({position, destination(position), error});
  quadric_[v].add(quadric_[u]);
  for (std::size_t w = 0; w < ring_wedges_.size(); ++w) {
    const std::uint32_t wedge = ring_wedges_[w];
    if (target_[w] == kNone) {
      target_[w] = mesh_.add_wedge(wedge, destination(mesh_.wedge_position(wedge)));
      if (channels_ == 0) continue;
      attribute_quadric_.push_copy(wedge);
      for (std::size_t k = 0; k < channels_; ++k) attribute_.push_back(attribute_[wedge * channels_ + k]);
    } else if (channels_ > 0) {
      attribute_quadric_.add(target_[w], wedge);
    }
  }
  mesh_.collapse(u, v, [&](std::uint32_t wedge) {
    return target_[static_cast<std::size_t>(std::find(ring_wedges_.begin(), ring_wedges_.end(), wedge) -
                                            ring_wedges_.begin())];
  });
}

/// Points without a legal collapse are looked at again when their own ring changes; changes two edges away
/// may free them as well, so before giving up all of them are tried once more.
bool CollapseEngine::retry_locked() {
  if (given_up_at_ == collapses_.size()) return false;
  given_up_at_ = collapses_.size();
  some_too_far_ = false;
  for (std::uint32_t p = 0; p < mesh_.point_count(); ++p)
    if (mesh_.is_alive(p) && !queue_.contains(p)) refresh(p);
  return !queue_.empty();
}

CollapseStop CollapseEngine::run_to(std::uint32_t positions, int scale, const RunContext& context) {
  const bool thesis = options_.order == CollapseOrder::kThesis;
  constexpr int kRetries = 8;  // each costs a pass over all points; later ones free next to nothing
  int retries = 0;
  std::vector<std::uint32_t> ring;
  for (std::uint32_t step = 0; mesh_.alive_positions() > positions; ++step) {
    if (step % 4096 == 0) context.check_cancelled();
    if (mesh_.alive_faces() <= static_cast<std::uint32_t>(options_.min_triangles))
      return CollapseStop::kFewTriangles;
    if (queue_.empty() && (++retries > kRetries || !retry_locked()))
      return some_too_far_ ? CollapseStop::kTooFar : CollapseStop::kLocked;
    const std::uint32_t u = queue_.top();
    if (thesis && persistence_[u] >= scale) return CollapseStop::kReached;
    fade_ = std::min(1.0, mesh_.alive_positions() / (kFadeBelow * initial_positions_));
    const Best best = evaluate(u);
    if (!best.found) {
      queue_.erase(u);
      continue;
    }
    if (best.key > queue_.key(u)) {
      queue_.set(u, best.key);
      if (queue_.top() != u) continue;
      // Still the cheapest; the ring in scratch is its own.
    }
    const Neighbour chosen = neighbours_[best.slot];
    ring.clear();
    for (const Neighbour& n : neighbours_) ring.push_back(n.point);
    apply(u, chosen);
    queue_.erase(u);
    // Costs changed around u only. Farther neighbours of the target may have become free, or no longer be:
    // the first are tried now, the second when their turn comes.
    const std::size_t around = ring.size();
    gather(chosen.point);
    for (const Neighbour& n : neighbours_)
      if (!queue_.contains(n.point) &&
          std::find(ring.begin(), ring.begin() + static_cast<std::ptrdiff_t>(around), n.point) ==
              ring.begin() + static_cast<std::ptrdiff_t>(around))
        ring.push_back(n.point);
    for (std::uint32_t p : ring) refresh(p);
  }
  return CollapseStop::kReached;
}

}  // namespace texmesh
