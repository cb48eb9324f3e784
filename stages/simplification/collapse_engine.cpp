#include "stages/simplification/collapse_engine.h"

#include "stages/base/parallel.h"

namespace texmesh {
namespace {

constexpr double kFadeBelow = 0.05;  // of the vertices: there the attributes' weight starts to fall to 0
// A little of the moved distance keeps flat places, where every collapse is free, from growing slivers.
constexpr double kDistanceWeight = 1e-6;
// The hub of a fan of more corners is left alone until the fan has shrunk: every look at it, or at what would
// collapse into it, takes as many steps.
constexpr std::uint32_t kMostCorners = 256;

// A full step of a colour channel counts as much as a shift by a twentieth of the diagonal.
constexpr double kColourLength = 0.05;
constexpr double kTint = 0.5;  // of the colours' weight where there is a texture
// Normals that turn a normal map weigh more than its shape tells. Mean lit FLIP at 1/2 to 1/20 of the
// triangles against 1: a bust -9 %, a statue of folds -4 %, a flight helmet -6 %; 20 and 40 are worse for the
// helmet.
constexpr double kFrameWeight = 8;
// Where charts are folded to slivers the gradient of the texture runs away; its square must not.
constexpr double kSteepest = 64;

Vec3d face_normal(const CollapseMesh& mesh, const CollapseMesh::Face& face) {
  const Vec3d a = mesh.point(face.point[0]);
  return cross(mesh.point(face.point[1]) - a, mesh.point(face.point[2]) - a);
}

/// Per material: how long one unit of UV is on the surface, so that the texture's distortion is a length like
/// the shape's.
std::vector<double> texture_lengths(const CollapseMesh& mesh, const Mesh& input) {
  std::vector<double> surface, texture, scale;
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f) {
    const CollapseMesh::Face& face = mesh.faces()[f];
    const std::size_t material = input.triangle_material[mesh.face_source(f)];
    if (material >= surface.size()) surface.resize(material + 1), texture.resize(material + 1);
    surface[material] += length(face_normal(mesh, face));
    const Vec2d a = mesh.wedge_uv(face.wedge[0]);
    texture[material] += std::fabs(cross(mesh.wedge_uv(face.wedge[1]) - a, mesh.wedge_uv(face.wedge[2]) - a));
  }
  for (std::size_t m = 0; m < surface.size(); ++m)
    scale.push_back(texture[m] > 0 ? std::sqrt(surface[m] / texture[m]) : 0);
  return scale;
}

double mean_edge(const CollapseMesh& mesh) {
  double sum = 0;
  for (const CollapseMesh::Face& face : mesh.faces())
    for (std::size_t k = 0; k < 3; ++k)
      sum += length(mesh.point(face.point[(k + 1) % 3]) - mesh.point(face.point[k]));
  return sum / (3 * static_cast<double>(std::max<std::size_t>(mesh.faces().size(), 1)));
}

bool colours_vary(const Mesh& input, auto&& same) {
  return !std::all_of(input.colours.begin(), input.colours.end(),
                      [&](const Vec4f& c) { return same(c, input.colours[0]); });
}

}  // namespace

CollapseEngine::CollapseEngine(const ConditionedMesh& input, const ScaleMap& scale_map,
                               const SimplificationOptions& options, const RunContext& context)
    : options_(options),
      mesh_(input),
      cost_(mesh_, input.mesh, options),
      components_(mesh_, input),
      ring_(mesh_),
      initial_positions_(mesh_.alive_positions()),
      persistence_(mesh_.point_count(), 0),
      flags_(mesh_.point_count(), 0),
      target_(mesh_.point_count(), kNone),
      queue_(mesh_.point_count(), components_.count()) {
  for (std::uint32_t p = 0; p < mesh_.point_count(); ++p)
    for (std::uint32_t position : mesh_.members(p))
      persistence_[p] = std::max(persistence_[p], scale_map.persistence[position]);
  context.check_cancelled();
  fill_queue(context);
}

void CollapseEngine::fill_queue(const RunContext& context) {
  const std::size_t count = mesh_.point_count();
  std::vector<double> key(count, 0);
  const std::size_t threads = static_cast<std::size_t>(std::max(context.threads, 1));
  parallel_for(
      context, count, std::max<std::size_t>(count / threads + 1, 4096),
      [&](std::size_t begin, std::size_t end) {
        CollapseRing ring(mesh_);
        WedgeMap map;
        for (std::size_t p = begin; p < end; ++p) {
          const Choice choice = evaluate(ring, static_cast<std::uint32_t>(p), map);
          flags_[p] = static_cast<std::uint8_t>((choice.exact ? kExact : 0) | (choice.too_far ? kTooFar : 0));
          if (!choice.found()) continue;
          target_[p] = ring.neighbours()[choice.slot].point;
          key[p] = choice.key;
        }
      });
  for (std::uint32_t p = 0; p < count; ++p)
    if (target_[p] != kNone) queue_.append(Removable::point(p), key[p]);
  if (options_.order != CollapseOrder::kThesis)
    for (std::uint32_t c = 0; c < components_.count(); ++c)
      if (c != components_.largest && components_.size[c] <= options_.max_error)
        queue_.append(Removable::component(c), components_.cost[c]);
  queue_.order();
}

/// Asks for the data of the next collapses ahead of time. The cheapest collapses lie anywhere on the surface:
/// on millions of triangles nearly all time would go in waiting for memory. What comes out next stands in the
/// first places of the heap, the sooner the nearer to its top. Lists come first, then corners, then faces,
/// since one leads to the next.
void CollapseEngine::prefetch_next() const {
  constexpr std::size_t kFaces = 5, kCorners = 21, kLists = 85;  // ends of the levels of a 4-ary heap
  const std::size_t count = std::min(queue_.size(), kLists);
  const auto is_point = [&](std::size_t i) { return !queue_.item(i).is_component(); };
  const auto point = [&](std::size_t i) { return queue_.item(i).index(); };
  for (std::size_t i = kCorners; i < count; ++i)
    if (is_point(i)) mesh_.prefetch_list(point(i));
  for (std::size_t i = kFaces; i < std::min(count, kCorners); ++i)
    if (is_point(i)) mesh_.prefetch_corners(point(i)), cost_.prefetch_point(point(i));
  std::size_t next = 0;
  for (std::size_t i = 1; i < std::min(count, kFaces); ++i) {
    if (!is_point(i)) continue;
    mesh_.prefetch_faces(point(i));
    if (next == 0 || queue_.less(i, next)) next = i;
  }
  if (next == 0) return;
  for (std::uint32_t entry : mesh_.corners(point(next))) {
    const CollapseMesh::Face& face = mesh_.faces()[entry / 4];
    if (!face.alive()) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      mesh_.prefetch_point(face.point[k]);
      ring_.prefetch(face.point[k]);
      cost_.prefetch_wedge(face.wedge[k]);
    }
  }
}

/// The part of a collapse's cost that needs no wedge map, a lower bound of the whole.
double CollapseEngine::shape_cost(std::uint32_t u, std::uint32_t v) const {
  const Vec3d p = mesh_.point(v), moved = p - mesh_.point(u);
  const Quadric& q = cost_.quadric(u);
  const double weight = options_.persistence_weight * persistence_[u];
  return (q.at(p) + kDistanceWeight * q.weight * dot(moved, moved)) * (1 + weight);
}

/// In the unit-diagonal frame.
double CollapseEngine::error_of(std::uint32_t u, std::uint32_t v) const {
  const Quadric& q = cost_.quadric(u);
  return q.weight > 0 ? std::sqrt(q.at(mesh_.point(v)) / q.weight) : 0;
}

/// The cheapest collapse of u that is allowed, and its wedge map.
CollapseEngine::Choice CollapseEngine::evaluate(CollapseRing& ring, std::uint32_t u, WedgeMap& map) const {
  if (mesh_.corner_count(u) > kMostCorners) return {};
  ring.gather(u);
  return choose(ring, map);
}

CollapseEngine::Choice CollapseEngine::choose(CollapseRing& ring, WedgeMap& map) const {
  using State = Neighbour::State;
  const std::uint32_t u = ring.centre();
  const bool thesis = options_.order == CollapseOrder::kThesis;
  Choice choice;
  map.slot = kNone;
  for (Neighbour& n : ring.neighbours()) {
    n.state = State::kOut;
    if (!ring.allowed_by_borders(n) || mesh_.corner_count(n.point) > kMostCorners) continue;
    n.error = error_of(u, n.point);
    if (n.error > options_.max_error) {
      choice.too_far = true;
      continue;
    }
    const Vec3d moved = mesh_.point(n.point) - mesh_.point(u);
    n.cost = thesis ? dot(moved, moved) : shape_cost(u, n.point);
    n.state = State::kBounded;
  }
  for (;;) {
    std::uint32_t slot = kNone;
    for (std::uint32_t i = 0; i < ring.neighbours().size(); ++i) {
      const Neighbour& n = ring.neighbours()[i];
      if (n.state == State::kOut) continue;
      const Neighbour* best = slot == kNone ? nullptr : &ring.neighbours()[slot];
      if (!best || n.cost < best->cost || (n.cost == best->cost && n.point < best->point)) slot = i;
    }
    if (slot == kNone) return choice;
    Neighbour& n = ring.neighbours()[slot];
    if (map.slot != slot && !ring.map_wedges(slot, map)) {
      n.state = State::kOut;
      choice.exact = false;
    } else if (n.state == State::kBounded && cost_.has_attributes()) {
      // The rest of the cost is only asked for where the shape's part is the least.
      const double weight = options_.persistence_weight * persistence_[u];
      const CollapseCost::Distortion d = cost_.distortion(ring, map);
      n.cost += fade_ * d.cost * (1 + weight);
      n.state = State::kPriced;
      if (d.shift <= options_.max_shift) continue;
      n.state = State::kOut;
      choice.exact = false;
      choice.too_far = true;
    } else if (ring.keeps_topology(slot) && ring.keeps_orientation(map)) {
      choice.slot = slot;
      choice.key = thesis ? persistence_[u] : n.cost;
      return choice;
    } else {
      n.state = State::kOut;
      choice.exact = false;
    }
  }
}

/// Looks at a point whose key has come out first. Where nothing has changed around the point, this only asks
/// whether its collapse is still legal.
CollapseEngine::Choice CollapseEngine::confirm(std::uint32_t u, WedgeMap& map) {
  ring_.gather(u);
  if (flags_[u] & kStale) return choose(ring_, map);
  for (std::uint32_t slot = 0; slot < ring_.neighbours().size(); ++slot) {
    Neighbour& n = ring_.neighbours()[slot];
    if (n.point != target_[u]) continue;
    if (!ring_.allowed_by_borders(n) || !ring_.map_wedges(slot, map) || !ring_.keeps_topology(slot) ||
        !ring_.keeps_orientation(map))
      break;
    n.error = error_of(u, n.point);
    return {.slot = slot, .key = queue_.key(Removable::point(u)), .exact = (flags_[u] & kExact) != 0};
  }
  return choose(ring_, map);
}

void CollapseEngine::enqueue(std::uint32_t u, std::uint32_t target_point, const Choice& choice) {
  flags_[u] = static_cast<std::uint8_t>((choice.exact ? kExact : 0) | (choice.too_far ? kTooFar : 0));
  target_[u] = target_point;
  if (choice.found())
    queue_.set(Removable::point(u), choice.key);
  else
    queue_.erase(Removable::point(u));
}

void CollapseEngine::reevaluate(std::uint32_t u) {
  const Choice choice = evaluate(ring_, u, scratch_map_);
  enqueue(u, choice.found() ? ring_.neighbours()[choice.slot].point : kNone, choice);
}

/// Merges the ring's centre into the neighbour that the map is about.
void CollapseEngine::apply_collapse(const WedgeMap& map) {
  const Neighbour& n = ring_.neighbours()[map.slot];
  const std::uint32_t u = ring_.centre(), v = n.point;
  const auto error = static_cast<float>(n.error * mesh_.diagonal());
  for (std::uint32_t position : mesh_.members(u))
    collapses_.push_back({position, ring_.destination(n, position), error});
  wedge_target_ = map.target;
  for (std::size_t w = 0; w < wedge_target_.size(); ++w) {
    const std::uint32_t wedge = ring_.wedges()[w];
    if (wedge_target_[w] == kNone)
      wedge_target_[w] = mesh_.add_wedge(wedge, ring_.destination(n, mesh_.wedge_position(wedge)));
  }
  cost_.merge(ring_, map);
  around_.clear();
  for (const Neighbour& other : ring_.neighbours())
    if (other.point != v) around_.push_back(other.point);
  mesh_.collapse(u, v, [&](std::uint32_t wedge) {
    const auto& wedges = ring_.wedges();
    return wedge_target_[static_cast<std::size_t>(std::find(wedges.begin(), wedges.end(), wedge) -
                                                  wedges.begin())];
  });
}

/// Brings the keys up to date after a collapse into v. The key of v is computed anew. The points around the
/// one that is gone have v as a neighbour now. Points without a legal collapse, up to two edges away, may
/// have got one.
void CollapseEngine::update_around(std::uint32_t v) {
  const bool thesis = options_.order == CollapseOrder::kThesis;
  for (std::uint32_t x : around_) {
    const Removable item = Removable::point(x);
    if (!queue_.contains(item)) continue;
    if (!(flags_[x] & kExact)) {
      reevaluate(x);
      continue;
    }
    flags_[x] |= kStale;
    if (thesis) continue;
    const double bound = shape_cost(x, v);
    if (bound < queue_.key(item)) queue_.set(item, bound);
  }
  around_.clear();
  reevaluate(v);
  if (mesh_.corner_count(v) > kMostCorners) return;
  for (const Neighbour& n : ring_.neighbours())
    if (!queue_.contains(Removable::point(n.point))) around_.push_back(n.point);
  for (std::uint32_t x : around_) reevaluate(x);
}

void CollapseEngine::remove_component(std::uint32_t component) {
  const auto points = components_.members(component);
  const auto error = static_cast<float>(components_.size[component] * mesh_.diagonal());
  for (std::uint32_t p : points) {
    if (!mesh_.is_alive(p)) continue;
    for (std::uint32_t position : mesh_.members(p))
      collapses_.push_back(Collapse::with_component(position, error));
    queue_.erase(Removable::point(p));
  }
  mesh_.remove(points);
}

/// Tries all points without a legal collapse once more. They are looked at again whenever their own ring
/// changes, but changes farther away may free them as well.
bool CollapseEngine::retry_locked() {
  if (given_up_at_ == collapses_.size()) return false;
  given_up_at_ = collapses_.size();
  for (std::uint32_t p = 0; p < mesh_.point_count(); ++p)
    if (mesh_.is_alive(p) && !queue_.contains(Removable::point(p))) reevaluate(p);
  return !queue_.empty();
}

/// Order touching, where nothing else is left. False when that frees nothing, or has been done.
bool CollapseEngine::let_surfaces_touch() {
  if (options_.order != CollapseOrder::kTouching || ring_.surfaces_may_touch()) return false;
  ring_.let_surfaces_touch();
  given_up_at_ = static_cast<std::size_t>(-1);
  return retry_locked();
}

CollapseStop CollapseEngine::run_to(std::uint32_t positions, int scale, const RunContext& context) {
  const bool thesis = options_.order == CollapseOrder::kThesis;
  constexpr int kRetries = 8;  // each costs a pass over all points; later ones free next to nothing
  int retries = 0;
  WedgeMap map;  // of the choice in hand
  for (std::uint32_t step = 0; mesh_.alive_positions() > positions; ++step) {
    if (step % 4096 == 0) context.check_cancelled();
    if (mesh_.alive_faces() <= static_cast<std::uint32_t>(options_.min_triangles))
      return CollapseStop::kFewTriangles;
    if (queue_.empty() && (++retries > kRetries || !retry_locked()) && !let_surfaces_touch()) {
      for (std::uint32_t p = 0; p < mesh_.point_count(); ++p)
        if (mesh_.is_alive(p) && flags_[p] & kTooFar) return CollapseStop::kTooFar;
      return CollapseStop::kLocked;
    }
    const Removable first = queue_.top();
    if (first.is_component()) {
      queue_.erase(first);
      remove_component(first.index());
      continue;
    }
    const std::uint32_t u = first.index();
    if (thesis && persistence_[u] >= scale) return CollapseStop::kReached;
    prefetch_next();
    fade_ = std::min(1.0, mesh_.alive_positions() / (kFadeBelow * initial_positions_));
    const Choice choice = confirm(u, map);
    if (!choice.found()) {
      enqueue(u, kNone, choice);
      continue;
    }
    const std::uint32_t v = ring_.neighbours()[choice.slot].point;
    if (choice.key > queue_.key(first)) {
      enqueue(u, v, choice);
      if (queue_.top() != first) continue;
      // Still the cheapest; the ring in scratch is its own.
    }
    apply_collapse(map);
    queue_.erase(first);
    update_around(v);
  }
  return CollapseStop::kReached;
}

void CollapseQueue::append(Removable item, double key) {
  heap_.push_back({key, item});
  at(item) = static_cast<std::uint32_t>(heap_.size() - 1);
}

void CollapseQueue::order() {
  for (std::size_t i = heap_.size() / 4 + 1; i-- > 0;)
    if (i < heap_.size()) sift_down(i);
}

void CollapseQueue::set(Removable item, double key) {
  const std::uint32_t i = at(item);
  if (i == kNoIndex) {
    append(item, key);
    sift_up(heap_.size() - 1);
    return;
  }
  const double old = heap_[i].key;
  heap_[i].key = key;
  if (key < old)
    sift_up(i);
  else if (key > old)
    sift_down(i);
}

void CollapseQueue::erase(Removable item) {
  const std::uint32_t i = at(item);
  if (i == kNoIndex) return;
  at(item) = kNoIndex;
  const Entry last = heap_.back();
  heap_.pop_back();
  if (last.item == item) return;
  place(i, last);
  sift_up(i);
  sift_down(at(last.item));
}

void CollapseQueue::sift_up(std::size_t i) {
  const Entry entry = heap_[i];
  while (i > 0 && entry < heap_[(i - 1) / 4]) {
    place(i, heap_[(i - 1) / 4]);
    i = (i - 1) / 4;
  }
  place(i, entry);
}

void CollapseQueue::sift_down(std::size_t i) {
  const Entry entry = heap_[i];
  for (;;) {
    std::size_t least = 4 * i + 1;
    if (least >= heap_.size()) break;
    const std::size_t end = std::min(least + 4, heap_.size());
    for (std::size_t c = least + 1; c < end; ++c)
      if (heap_[c] < heap_[least]) least = c;
    if (!(heap_[least] < entry)) break;
    place(i, heap_[least]);
    i = least;
  }
  place(i, entry);
}

CollapseCost::CollapseCost(const CollapseMesh& mesh, const Mesh& input, const SimplificationOptions& options)
    : mesh_(mesh) {
  add_shape();
  add_lines(input, options);
  if (options.order != CollapseOrder::kThesis) add_attributes(input, options);
}

void CollapseCost::add_shape() {
  quadric_.resize(mesh_.point_count());
  for (const CollapseMesh::Face& face : mesh_.faces()) {
    const Vec3d n = face_normal(mesh_, face);
    const double area = length(n) / 2;
    if (!(area > 0)) continue;
    const Vec3d unit = n * (0.5 / area);
    const double d = -dot(unit, mesh_.point(face.point[0]));
    for (std::uint32_t p : face.point) quadric_[p].add_plane(unit, d, area);
  }
}

/// Planes that stand on open borders, on borders of materials, and on seams of the texture.
void CollapseCost::add_lines(const Mesh& input, const SimplificationOptions& options) {
  CollapseRing ring(mesh_);
  constexpr std::uint32_t kUnseen = kNoIndex;
  struct Uses {
    std::uint32_t first = kUnseen;
    bool mixed = false;
  };
  std::vector<Uses> uses;  // per neighbour: materials of the faces at the edge
  for (std::uint32_t u = 0; u < mesh_.point_count(); ++u) {
    ring.gather(u);
    uses.assign(ring.neighbours().size(), {});
    for (const CollapseRing::Corner& corner : ring.corners()) {
      const std::uint32_t use = input.triangle_material[mesh_.face_source(corner.face)];
      for (std::uint32_t slot : {corner.a, corner.b}) {
        uses[slot].mixed = uses[slot].mixed || (uses[slot].first != kUnseen && uses[slot].first != use);
        uses[slot].first = use;
      }
    }
    for (const CollapseRing::Corner& corner : ring.corners()) {
      const CollapseRing::Neighbour& n = ring.neighbours()[corner.a];  // every edge of a face once
      const bool border = n.valence != 2 || uses[corner.a].mixed;
      const double factor = border ? options.boundary_weight : n.is_seam() ? options.seam_weight : 0;
      if (!(factor > 0)) continue;
      const Vec3d a = mesh_.point(u), edge = mesh_.point(n.point) - a;
      const Vec3d across = normalized(cross(edge, face_normal(mesh_, mesh_.faces()[corner.face])));
      const double weight = factor * dot(edge, edge);
      if (!(weight > 0) || across == Vec3d{}) continue;
      quadric_[u].add_plane(across, -dot(across, a), weight);
      quadric_[n.point].add_plane(across, -dot(across, a), weight);
    }
  }
}

void CollapseCost::add_attributes(const Mesh& input, const SimplificationOptions& options) {
  const bool normal = options.normal_weight > 0 && !input.normals.empty();
  const bool colour = options.colour_weight > 0;
  colour_varies_ = colour && colours_vary(input, [](const Vec4f& a, const Vec4f& b) {
                     return a.x == b.x && a.y == b.y && a.z == b.z;
                   });
  alpha_varies_ = colour && colours_vary(input, [](const Vec4f& a, const Vec4f& b) { return a.w == b.w; });
  texture_channels_ = options.uv_weight > 0 && mesh_.has_uv() ? 2 : 0;
  const std::size_t channels =
      texture_channels_ + (normal ? 3 : 0) + (colour_varies_ ? 3 : 0) + (alpha_varies_ ? 1 : 0);
  attribute_quadric_ = AttributeQuadrics(channels);
  if (channels == 0) return;
  if (texture_channels_ > 0) shift_per_cost_ = 1 / options.uv_weight;
  attribute_.assign(mesh_.wedge_count() * channels, 0);
  attribute_quadric_.resize(mesh_.wedge_count());
  fill_attributes(input, options);
  for (const CollapseMesh::Face& face : mesh_.faces()) add_gradients(face);
}

/// The weights of the kinds are in the lengths already.
void CollapseCost::fill_attributes(const Mesh& input, const SimplificationOptions& options) {
  const std::size_t channels = attribute_quadric_.channels();
  std::vector<double> texture;
  if (texture_channels_ > 0) texture = texture_lengths(mesh_, input);
  const double texture_factor = std::sqrt(options.uv_weight);
  const double frames = input.tangents.empty() ? 1 : kFrameWeight;
  const double normal_length = std::sqrt(options.normal_weight * frames) * mean_edge(mesh_);
  // Beside a texture, which has the photograph, colours are tints.
  const double alpha_length = std::sqrt(options.colour_weight) * kColourLength;
  const double colour_length = alpha_length * (texture_channels_ > 0 ? std::sqrt(kTint) : 1);
  const bool normal = options.normal_weight > 0 && !input.normals.empty();
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f)
    for (std::uint32_t w : mesh_.faces()[f].wedge) {
      double* at = attribute_.data() + w * channels;
      const std::uint32_t source = mesh_.wedge_source(w);
      if (texture_channels_ > 0) {
        const double s = texture_factor * texture[input.triangle_material[mesh_.face_source(f)]];
        const Vec2d uv = mesh_.wedge_uv(w);
        *at++ = s * uv.x, *at++ = s * uv.y;
      }
      if (normal)
        for (int k = 0; k < 3; ++k) *at++ = normal_length * input.normals[source][k];
      if (!colour_varies_ && !alpha_varies_) continue;
      const Vec4f c = input.colours[source];
      if (colour_varies_)
        *at++ = colour_length * c.x, *at++ = colour_length * c.y, *at++ = colour_length * c.z;
      if (alpha_varies_) *at++ = alpha_length * c.w;
    }
}

void CollapseCost::add_gradients(const CollapseMesh::Face& face) {
  const std::size_t channels = attribute_quadric_.channels();
  const Vec3d p0 = mesh_.point(face.point[0]);
  const Vec3d e1 = mesh_.point(face.point[1]) - p0, e2 = mesh_.point(face.point[2]) - p0;
  const Vec3d n = cross(e1, e2);
  const double square = dot(n, n);
  if (!(square > 0)) return;
  double area = std::sqrt(square) / 2;
  const Vec3d along1 = cross(e2, n) * (1 / square), along2 = cross(n, e1) * (1 / square);
  std::array<Vec3d, AttributeQuadrics::kMaxChannels> gradient;
  double steepest = 0;
  for (std::size_t k = 0; k < channels; ++k) {
    const double s0 = attributes(face.wedge[0])[k];
    gradient[k] = along1 * (attributes(face.wedge[1])[k] - s0) + along2 * (attributes(face.wedge[2])[k] - s0);
    if (k < texture_channels_) steepest = std::max(steepest, dot(gradient[k], gradient[k]));
  }
  if (steepest > kSteepest) area *= kSteepest / steepest;
  for (std::uint32_t w : face.wedge) {
    for (std::size_t k = 0; k < channels; ++k) attribute_quadric_.add_channel(w, k, gradient[k], area);
    attribute_quadric_.add_area(w, area);
  }
}

AttributeQuadrics::Step CollapseCost::step(std::uint32_t from, std::uint32_t to) const {
  AttributeQuadrics::Step s{};
  const double *a = attributes(from), *b = attributes(to);
  for (std::size_t k = 0; k < attribute_quadric_.channels(); ++k) s[k] = b[k] - a[k];
  return s;
}

CollapseCost::Distortion CollapseCost::distortion(const CollapseRing& ring,
                                                  const CollapseRing::WedgeMap& map) const {
  const Vec3d move = mesh_.point(ring.neighbours()[map.slot].point) - mesh_.point(ring.centre());
  Distortion d;
  double area = 0;
  for (std::size_t i = 0; i < ring.wedges().size(); ++i) {
    const std::uint32_t wedge = ring.wedges()[i], target = map.target[i];
    d.cost += attribute_quadric_.at(
        wedge, move, target == CollapseRing::kNone ? AttributeQuadrics::Step{} : step(wedge, target));
    area += attribute_quadric_.area(wedge);
  }
  if (texture_channels_ > 0 && area > 0) d.shift = std::sqrt(d.cost * shift_per_cost_ / area);
  return d;
}

void CollapseCost::merge(const CollapseRing& ring, const CollapseRing::WedgeMap& map) {
  const std::uint32_t point = ring.neighbours()[map.slot].point;
  quadric_[point].add(quadric_[ring.centre()]);
  if (!has_attributes()) return;
  const std::size_t channels = attribute_quadric_.channels();
  const Vec3d move = mesh_.point(point) - mesh_.point(ring.centre());
  for (std::size_t i = 0; i < ring.wedges().size(); ++i) {
    const std::uint32_t wedge = ring.wedges()[i];
    if (map.target[i] == CollapseRing::kNone) {
      attribute_quadric_.push_moved(wedge, move);
      for (std::size_t k = 0; k < channels; ++k) {
        const double value = attribute_[wedge * channels + k];
        attribute_.push_back(value);
      }
    } else {
      attribute_quadric_.merge(map.target[i], wedge, move, step(wedge, map.target[i]));
    }
  }
}

CollapseComponents::CollapseComponents(const CollapseMesh& mesh, const ConditionedMesh& input)
    : size(input.component_count, 0), cost(input.component_count, 0) {
  auto component = [&](std::uint32_t p) { return input.component[mesh.members(p)[0]]; };
  points = in_buckets(count(), [&](auto&& put) {
    for (std::uint32_t p = 0; p < mesh.point_count(); ++p) put(component(p), p);
  });
  std::vector<Box3d> box(count());
  for (std::uint32_t p = 0; p < mesh.point_count(); ++p) box[component(p)].extend(mesh.point(p));

  std::vector<double> area(count(), 0);
  for (const CollapseMesh::Face& face : mesh.faces()) {
    const Vec3d a = mesh.point(face.point[0]);
    area[component(face.point[0])] +=
        length(cross(mesh.point(face.point[1]) - a, mesh.point(face.point[2]) - a)) / 2;
  }
  for (std::size_t c = 0; c < count(); ++c) {
    size[c] = box[c].diagonal();
    // What moving the whole component by half its size would cost. Every area stands in the quadrics of three
    // corners, hence 3.
    cost[c] = 3 * area[c] * size[c] * size[c] / 4;
    if (area[c] > area[largest]) largest = static_cast<std::uint32_t>(c);
  }
}

}  // namespace texmesh
