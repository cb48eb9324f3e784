#pragma once
// Inside the room only: pairs of vertices, or of charts, in the order in which they become one; a chart's
// triangles laid into a plane; which cells of a texture a chart touches, and which are taken.
#include <array>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// Two members and what it costs to join them. An entry is stale when one of the two has changed since: then
/// the sum of their versions is another.
struct QueuedPair {
  float cost = 0;
  std::uint32_t a = 0, b = 0, stamp = 0, tries = 0;
  /// True for what is joined later; ties go by index, so that the order is the same everywhere.
  friend bool operator<(const QueuedPair& x, const QueuedPair& y) {
    if (x.cost != y.cost) return x.cost > y.cost;
    return std::tie(x.a, x.b, x.stamp, x.tries) > std::tie(y.a, y.b, y.stamp, y.tries);
  }
};

/// A heap of pairs, four below each: half as deep as one of two, and they lie side by side. Stale entries are
/// swept out when they may be half of all, so memory stays linear.
class PairQueue {
 public:
  explicit PairQueue(std::size_t member_count) : versions_(member_count, 0) {}

  bool empty() const { return heap_.empty(); }
  bool is_fresh(const QueuedPair& e) const { return e.stamp == versions_[e.a] + versions_[e.b]; }
  /// Makes all entries of the member stale.
  void touch(std::uint32_t member) { ++versions_[member]; }
  void push(std::uint32_t a, std::uint32_t b, double cost, std::uint32_t tries = 0) {
    if (heap_.size() >= sweep_at_) sweep();
    const QueuedPair e{static_cast<float>(cost), std::min(a, b), std::max(a, b), versions_[a] + versions_[b],
                       tries};
    std::size_t i = heap_.size();
    heap_.push_back(e);
    for (; i > 0 && heap_[(i - 1) / kBelow] < e; i = (i - 1) / kBelow) heap_[i] = heap_[(i - 1) / kBelow];
    heap_[i] = e;
  }
  QueuedPair pop() {
    const QueuedPair first = heap_.front(), last = heap_.back();
    heap_.pop_back();
    if (!heap_.empty()) put_below(0, last);
    return first;
  }

 private:
  /// Puts an entry at i or below; all that is below is in order.
  void put_below(std::size_t i, const QueuedPair e) {
    for (std::size_t first = kBelow * i + 1; first < heap_.size(); first = kBelow * i + 1) {
      const auto end = heap_.begin() + static_cast<std::ptrdiff_t>(std::min(first + kBelow, heap_.size()));
      const auto next = std::max_element(heap_.begin() + static_cast<std::ptrdiff_t>(first), end);
      if (!(e < *next)) break;
      heap_[i] = *next;
      i = static_cast<std::size_t>(next - heap_.begin());
    }
    heap_[i] = e;
  }

  void sweep() {
    std::erase_if(heap_, [&](const QueuedPair& e) { return !is_fresh(e); });
    for (std::size_t i = heap_.size() / kBelow + 1; i-- > 0;)
      if (i < heap_.size()) put_below(i, heap_[i]);
    sweep_at_ = std::max<std::size_t>(2 * heap_.size(), kLeastSweep);
  }

  static constexpr std::size_t kBelow = 4, kLeastSweep = 1 << 12;
  std::vector<QueuedPair> heap_;
  std::vector<std::uint32_t> versions_;  // per member
  std::size_t sweep_at_ = kLeastSweep;
};

/// Two unit vectors of the plane across a normal: x to the right and y up for who looks at the front.
struct PlaneAxes {
  Vec3d x, y;
  explicit PlaneAxes(Vec3d unit_normal);
  Vec2d operator()(Vec3d p) const { return {dot(p, x), dot(p, y)}; }
};

/// A triangle in its own plane: corners at (0, 0), (base, 0) and apex; base and apex.y are above 0.
struct OwnPlane {
  double base = 0;
  Vec2d apex;
  OwnPlane() = default;
  explicit OwnPlane(const std::array<Vec3d, 3>& corners);
  double area() const { return base * apex.y / 2; }
};

/// The map from a triangle's own plane to three places: what it does to lengths and to areas.
struct FlatStretch {
  double largest2 = 0, least2 = 0;  // squares of the singular values
  double area = 0;                  // of the places; not above 0 when the triangle flips or has none
};
FlatStretch flat_stretch(const OwnPlane& own, const Vec2d* places);

/// Half-edges 3 t + k, which are a chart's border, do not meet in the plane but at common vertices.
/// `vertices` and `places`: per corner 3 t + k. With no triangle flipped, this says that no two triangles of
/// a disk overlap.
bool border_is_simple(std::span<const std::uint32_t> half_edges, const std::vector<std::uint32_t>& vertices,
                      const std::vector<Vec2d>& places);

/// The unit vector along one side of the smallest box around the points; {1, 0} when they have no extent.
Vec2d smallest_box_side(std::vector<Vec2d> points);

/// Cells that are touched, as runs of each row.
struct ChartMask {
  struct Run {
    std::uint32_t row = 0, first = 0, count = 0;
  };
  std::uint32_t width = 0, height = 0;  // cells
  std::vector<Run> runs;                // by row, then by first; runs of a row do not touch
  std::uint64_t cell_count() const;
};

/// The cells, unit squares, whose inside the triangles touch. Corners lie in [0, width] x [0, height].
ChartMask mask_of(std::span<const std::array<Vec2d, 3>> triangles, std::uint32_t width, std::uint32_t height);

/// The mask turned by a quarter: (x, y) -> (height - y, x).
ChartMask quarter_turned(const ChartMask& mask);

/// A bitmap that charts are put on. 64 places are tried at once: the places of a row that a run of cells
/// forbids are the row's taken cells, moved by each of the run's offsets and joined. Rows are kept joined
/// over 1, 2, 4, ... offsets, so two of these make those of any run.
class PackingGrid {
 public:
  PackingGrid(std::uint32_t width, std::uint32_t height, std::uint32_t gutter);

  struct Place {
    std::uint32_t x = 0, y = 0;
  };
  /// The topmost place where the mask meets nothing that is taken, of these the leftmost; its row is at most
  /// `last_row`.
  std::optional<Place> first_free(const ChartMask& mask, std::uint32_t last_row);
  /// Takes the mask's cells and those within the gutter, diagonals included.
  void take(const ChartMask& mask, Place place);

 private:
  bool may_hold(std::span<const ChartMask::Run> runs, std::uint32_t y) const;
  bool forbid(std::span<const ChartMask::Run> runs, std::uint32_t width, std::uint32_t y);
  void forbid_run(std::uint32_t y, const ChartMask::Run& run);
  const std::uint64_t* joined(std::uint32_t y, std::uint32_t power);
  std::uint32_t widest_gap(std::uint32_t y);
  std::uint64_t* row(std::uint32_t y, std::uint32_t power = 0) {
    return &taken_[(std::size_t{y} * powers_ + power) * (words_ + 1)];
  }

  std::uint32_t width_, height_, gutter_, words_, powers_;
  // Per row: its words, bit x % 64 of word x / 64, and one word of 0; then the same for x or x + 1, for x to
  // x + 3, and so on.
  std::vector<std::uint64_t> taken_;
  std::vector<std::uint8_t> made_;        // per row: how many of these are up to date
  std::vector<std::uint32_t> gaps_;       // per row: free cells side by side, at most
  std::vector<std::uint64_t> forbidden_;  // one row
};

}  // namespace texmesh
