#pragma once
#include <compare>

#include "stages/simplification/collapse_cost.h"

namespace texmesh {

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
