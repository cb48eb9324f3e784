#pragma once
#include <compare>

#include "stages/geometry/quadric.h"
#include "stages/simplification/collapse_mesh.h"
#include "stages/simplification/simplification.h"

namespace texmesh {

/// Per wedge, how far K attributes (texture coordinates, normals, colours) at a point are from the linear
/// functions that the wedge's triangles carry (Hoppe 1999): sum over triangles t and channels k of area_t
/// (g_tk . p + d_tk - s_k)^2. Kept relative to the wedge's own place and attributes, so that single precision
/// is enough: what is left in there are differences over a few edges.
class AttributeQuadrics {
 public:
  static constexpr std::size_t kMaxChannels = 9;  // 2 + 3 + 4
  using Step = std::array<double, kMaxChannels>;  // a change of the attributes

  explicit AttributeQuadrics(std::size_t channels = 0) : channels_(channels), stride_(11 + 4 * channels) {}
  std::size_t channels() const { return channels_; }
  void resize(std::size_t wedges) { data_.resize(wedges * stride_); }
  /// Adds one channel of a triangle of the wedge, with gradient g; the triangle's area is added once, with
  /// add_area.
  void add_channel(std::size_t wedge, std::size_t k, Vec3d g, double area) {
    float* q = &data_[wedge * stride_];
    q[0] += f(area * g.x * g.x), q[1] += f(area * g.x * g.y), q[2] += f(area * g.x * g.z);
    q[3] += f(area * g.y * g.y), q[4] += f(area * g.y * g.z), q[5] += f(area * g.z * g.z);
    float* c = q + 11 + 4 * k;
    c[0] += f(area * g.x), c[1] += f(area * g.y), c[2] += f(area * g.z);
  }
  void add_area(std::size_t wedge, double area) { data_[wedge * stride_ + 10] += f(area); }
  void prefetch(std::size_t wedge) const {
    const float* q = &data_[wedge * stride_];
    __builtin_prefetch(q);
    __builtin_prefetch(q + stride_ - 1);
  }
  double area(std::size_t wedge) const { return data_[wedge * stride_ + 10]; }
  /// Adds the quadric of `from`, whose place and attributes `to` has at `-move` and `-step` of its own: the
  /// collapse moved the wedge by `move` and its attributes by `step`.
  void merge(std::size_t to, std::size_t from, Vec3d move, const Step& step) {
    std::array<float, 11 + 4 * kMaxChannels> shifted{};
    shift(&data_[from * stride_], move, step, shifted.data());
    float* a = &data_[to * stride_];
    for (std::size_t i = 0; i < stride_; ++i) a[i] += shifted[i];
  }
  /// A new wedge (its index is the count before) with the quadric of `from`, moved; its attributes stay.
  void push_moved(std::size_t from, Vec3d move) {
    std::array<float, 11 + 4 * kMaxChannels> shifted{};
    shift(&data_[from * stride_], move, Step{}, shifted.data());
    data_.insert(data_.end(), shifted.begin(), shifted.begin() + static_cast<std::ptrdiff_t>(stride_));
  }
  /// At `move` from the wedge's place, with attributes changed by `step`. Never negative.
  double at(std::size_t wedge, Vec3d move, const Step& step) const {
    const double r = value(&data_[wedge * stride_], move, step);
    return r > 0 ? r : 0;
  }

 private:
  static float f(double x) { return static_cast<float>(x); }
  double value(const float* q, Vec3d p, const Step& s) const {
    double r = p.x * (q[0] * p.x + 2 * (q[1] * p.y + q[2] * p.z + q[6])) +
               p.y * (q[3] * p.y + 2 * (q[4] * p.z + q[7])) + p.z * (q[5] * p.z + 2 * q[8]) + q[9];
    for (std::size_t k = 0; k < channels_; ++k) {
      const float* c = q + 11 + 4 * k;
      r += s[k] * (q[10] * s[k] - 2 * (c[0] * p.x + c[1] * p.y + c[2] * p.z + c[3]));
    }
    return r;
  }
  void shift(const float* q, Vec3d p, const Step& s, float* out) const {
    for (std::size_t i = 0; i < stride_; ++i) out[i] = q[i];
    double bx = q[6] + q[0] * p.x + q[1] * p.y + q[2] * p.z;
    double by = q[7] + q[1] * p.x + q[3] * p.y + q[4] * p.z;
    double bz = q[8] + q[2] * p.x + q[4] * p.y + q[5] * p.z;
    for (std::size_t k = 0; k < channels_; ++k) {
      const float* c = q + 11 + 4 * k;
      bx -= s[k] * c[0], by -= s[k] * c[1], bz -= s[k] * c[2];
      out[11 + 4 * k + 3] = f(c[3] + c[0] * p.x + c[1] * p.y + c[2] * p.z - q[10] * s[k]);
    }
    out[6] = f(bx), out[7] = f(by), out[8] = f(bz);
    out[9] = f(std::fmax(value(q, p, s), 0));
  }

  std::size_t channels_, stride_;
  std::vector<float> data_;  // per wedge: 6 of G, 3 of b, c, area, then (g, d) per channel
};

/// What a collapse costs: squared distance to the planes of all the triangles that a point stands for, to
/// planes that stand upright on borders and seams (so that these lines stay where they are), and the
/// distortion of texture, normals and colours, as lengths. In the frame of unit diagonal, times area.
class CollapseCost {
 public:
  CollapseCost(const CollapseMesh& mesh, const Mesh& input, const SimplificationOptions& options);

  const Quadric& quadric(std::uint32_t point) const { return quadric_[point]; }
  bool has_attributes() const { return attribute_quadric_.channels() > 0; }
  /// As CollapseMesh::prefetch_list.
  void prefetch_point(std::uint32_t point) const {
    const auto* q = reinterpret_cast<const char*>(&quadric_[point]);
    __builtin_prefetch(q);
    __builtin_prefetch(q + sizeof(Quadric) - 1);
  }
  void prefetch_wedge(std::uint32_t wedge) const {
    if (!has_attributes()) return;
    __builtin_prefetch(attributes(wedge));
    attribute_quadric_.prefetch(wedge);
  }
  struct Distortion {
    double cost = 0;
    double shift = 0;  // of the texture, root mean square over the area that the centre's wedges stand for
  };
  /// Of the ring's centre moved into the map's neighbour.
  Distortion distortion(const CollapseRing& ring, const CollapseRing::WedgeMap& map) const;
  /// Hands what the ring's centre carries to the map's neighbour, and what the ring's wedges carry to their
  /// targets. A wedge without a target gets a new one behind all others, in the ring's order, as
  /// CollapseMesh::add_wedge gives them.
  void merge(const CollapseRing& ring, const CollapseRing::WedgeMap& map);

 private:
  void add_shape();
  void add_lines(const Mesh& input, const SimplificationOptions& options);
  void add_attributes(const Mesh& input, const SimplificationOptions& options);
  void fill_attributes(const Mesh& input, const SimplificationOptions& options);
  void add_gradients(const CollapseMesh::Face& face);
  AttributeQuadrics::Step step(std::uint32_t from, std::uint32_t to) const;
  const double* attributes(std::uint32_t wedge) const {
    return attribute_.data() + wedge * attribute_quadric_.channels();
  }

  const CollapseMesh& mesh_;
  std::vector<Quadric> quadric_;                       // per point
  std::size_t texture_channels_ = 0;                   // the first of the channels
  bool colour_varies_ = false, alpha_varies_ = false;  // have channels, behind those of the normals
  double shift_per_cost_ = 0;                          // takes the weight of the texture out again
  std::vector<double> attribute_;                      // per wedge: its attributes as lengths
  AttributeQuadrics attribute_quadric_;                // per wedge
};

/// The connected components of the mesh, as things that can vanish whole.
struct CollapseComponents {
  Buckets<std::uint32_t> points;  // by component
  std::vector<double> size;       // diagonal of its bounding box, in the unit-diagonal frame
  std::vector<double> cost;       // of letting it vanish, in the unit of the collapses' costs
  std::uint32_t largest = 0;      // by area; the first of equals

  CollapseComponents(const CollapseMesh& mesh, const ConditionedMesh& input);
  std::size_t count() const { return size.size(); }
  std::span<const std::uint32_t> members(std::size_t c) const { return points[c]; }
};

/// What can be removed from a mesh at once: a point, by a collapse, or a whole component. Points are less
/// than components; among themselves both stand by their index, which is below 2^31.
class Removable {
 public:
  static Removable point(std::uint32_t index) { return Removable(index); }
  static Removable component(std::uint32_t index) { return Removable(index | kComponent); }
  bool is_component() const { return (value_ & kComponent) != 0; }
  std::uint32_t index() const { return value_ & ~kComponent; }
  friend auto operator<=>(Removable, Removable) = default;

 private:
  static constexpr std::uint32_t kComponent = 0x80000000;
  explicit Removable(std::uint32_t value) : value_(value) {}
  std::uint32_t value_;
};

/// 4-ary heap of points and components with changeable keys; of equal keys the lesser item comes out first.
/// The keys stand in the heap itself, so that a sift touches no other memory but the places it writes.
class CollapseQueue {
 public:
  CollapseQueue(std::size_t points, std::size_t components)
      : points_(points), at_(points + components, kNoIndex) {}
  bool empty() const { return heap_.empty(); }
  Removable top() const { return heap_[0].item; }
  /// The heap itself: what comes out after top() is among items 1 to 4, what comes next among 1 to 20.
  std::size_t size() const { return heap_.size(); }
  Removable item(std::size_t i) const { return heap_[i].item; }
  bool contains(Removable item) const { return at(item) != kNoIndex; }
  /// Of an item that the queue contains.
  double key(Removable item) const { return heap_[at(item)].key; }
  bool less(std::size_t i, std::size_t j) const { return heap_[i] < heap_[j]; }
  /// For an empty queue: all items at once, in linear time; call order() behind the last.
  void append(Removable item, double key);
  void order();
  /// Inserts the item, or moves it to where its new key belongs.
  void set(Removable item, double key);
  void erase(Removable item);

 private:
  struct Entry {
    double key;
    Removable item;
    bool operator<(const Entry& o) const { return key < o.key || (key == o.key && item < o.item); }
  };
  void place(std::size_t i, const Entry& entry) {
    heap_[i] = entry;
    at(entry.item) = static_cast<std::uint32_t>(i);
  }
  std::size_t number(Removable item) const { return (item.is_component() ? points_ : 0) + item.index(); }
  std::uint32_t& at(Removable item) { return at_[number(item)]; }
  std::uint32_t at(Removable item) const { return at_[number(item)]; }
  void sift_up(std::size_t i);
  void sift_down(std::size_t i);
  std::vector<Entry> heap_;
  std::size_t points_;
  std::vector<std::uint32_t> at_;  // per point, then per component: its place in the heap
};

/// Why run_to came back.
enum class CollapseStop : std::uint8_t { kReached, kFewTriangles, kTooFar, kLocked };

/// Carries the half-edge collapses out, cheapest first, on a CollapseMesh.
///
/// A point's key is the cost of its cheapest legal collapse when that was last looked for. A collapse changes
/// the rings around it, but what it adds to them is one new neighbour each; the keys of those points are
/// lowered to the bound that its shape alone gives, and only marked. Whether a marked key holds is looked at
/// when it comes out first. So a collapse costs about two searches through a ring instead of eight.
class CollapseEngine {
 public:
  CollapseEngine(const ConditionedMesh& input, const ScaleMap& scale_map,
                 const SimplificationOptions& options, const RunContext& context);

  /// Collapses until at most `positions` are left, or something else stops it. `scale` bounds the thesis
  /// order: it only removes points whose persistence is under it.
  CollapseStop run_to(std::uint32_t positions, int scale, const RunContext& context);

  CollapseMesh& mesh() { return mesh_; }
  const CollapseMesh& mesh() const { return mesh_; }
  const std::vector<Collapse>& collapses() const { return collapses_; }

 private:
  static constexpr std::uint32_t kNone = kNoIndex;
  using Neighbour = CollapseRing::Neighbour;
  using WedgeMap = CollapseRing::WedgeMap;
  /// What a look at a point's ring found.
  struct Choice {
    std::uint32_t slot = kNone;  // of the cheapest legal collapse, kNone = there is none
    double key = 0;
    bool exact = true;     // no cheaper one was refused: the key bounds what changes around may free
    bool too_far = false;  // some exceed max_error
    bool found() const { return slot != kNone; }
  };
  enum Flag : std::uint8_t { kStale = 1, kExact = 2, kTooFar = 4 };

  void fill_queue(const RunContext& context);
  void prefetch_next() const;
  double shape_cost(std::uint32_t u, std::uint32_t v) const;
  double error_of(std::uint32_t u, std::uint32_t v) const;
  Choice evaluate(CollapseRing& ring, std::uint32_t u, WedgeMap& map) const;
  Choice choose(CollapseRing& ring, WedgeMap& map) const;
  Choice confirm(std::uint32_t u, WedgeMap& map);
  void enqueue(std::uint32_t u, std::uint32_t target_point, const Choice& choice);
  void reevaluate(std::uint32_t u);
  void apply_collapse(const WedgeMap& map);
  void update_around(std::uint32_t v);
  void remove_component(std::uint32_t component);
  bool retry_locked();
  bool let_surfaces_touch();

  const SimplificationOptions& options_;
  CollapseMesh mesh_;
  CollapseCost cost_;
  CollapseComponents components_;
  CollapseRing ring_;
  std::uint32_t initial_positions_ = 0;
  double fade_ = 1;                        // of the attributes' weight
  std::vector<std::uint8_t> persistence_;  // per point: highest of its positions
  std::vector<std::uint8_t> flags_;        // per point
  std::vector<std::uint32_t> target_;      // per point in the queue: where its key takes it
  CollapseQueue queue_;
  std::vector<Collapse> collapses_;
  std::size_t given_up_at_ = static_cast<std::size_t>(-1);  // collapses when all had been tried in vain
  // Memory that is used again and holds nothing between two calls, but for around_: the points around the
  // collapse in hand.
  WedgeMap scratch_map_;
  std::vector<std::uint32_t> around_, wedge_target_;
};

}  // namespace texmesh
