#pragma once
#include <array>
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// Asks memory for what stands there, which will be read soon. Any address will do.
inline void ask_memory(const void* place) { __builtin_prefetch(place); }

/// Items in a row whose data lie anywhere in memory would wait for it a dozen times each. So memory is asked
/// for what the next ones read, in steps, each of which reads what the one before it has asked for. `Step`:
/// the steps in their order, an enumeration that ends with kCount. An item takes a step every `apart` items,
/// the last one `apart` items before its turn.
template <class Step, std::size_t apart>
struct LookAhead {
  static constexpr std::size_t kSteps = static_cast<std::size_t>(Step::kCount);
  static constexpr std::size_t kFarthest =
      kSteps * apart;  // items from the one at hand to that of the first step
  /// For every item: ask(step, ahead) for the one that comes `ahead` items later, the farthest first.
  static void each_step(auto&& ask) {
    for (std::size_t step = 0; step < kSteps; ++step) ask(static_cast<Step>(step), (kSteps - step) * apart);
  }
};

/// A mesh under refinement by vertex splits. Points and wedges are only ever appended; splits change which
/// wedges a face has.
class SplitMesh {
 public:
  using Point = std::array<std::int32_t, 3>;

  /// A corner at a point, as gather() leaves them: the face is (point, a, b) in its own direction.
  struct Corner {
    std::uint32_t face = 0, corner = 0, a = 0, b = 0, wedge = 0;
    bool moves = false;        // goes to the new point of a split,
    std::uint32_t target = 0;  // and gets this wedge there
  };
  /// Corners begin .. end of the gathered ones, each next to the one before. A closed fan goes round.
  struct Fan {
    std::uint32_t begin = 0, end = 0;
    bool closed = false;
  };

  SplitMesh() = default;
  /// `components`: per attribute, how many numbers each wedge has.
  explicit SplitMesh(std::vector<int> components);

  const std::vector<Point>& points() const { return points_; }                    // places on the grid
  const std::vector<std::uint32_t>& wedge_point() const { return wedge_point_; }  // per wedge
  std::size_t face_count() const { return faces_.size(); }
  const std::vector<std::uint16_t>& face_group() const { return face_group_; }
  /// Numbers of attribute k of all wedges, one wedge after the other.
  const std::vector<std::int32_t>& values(std::size_t k) const { return values_[k]; }
  int components(std::size_t k) const { return components_[k]; }
  std::size_t attributes() const { return components_.size(); }
  /// Faces whose three points are at different places; the others show nothing and are no triangles
  /// of a scale.
  std::vector<std::uint32_t> visible_faces() const;

  // For the codec:
  void reserve(std::size_t points, std::size_t wedges, std::size_t faces);
  std::uint32_t add_point();
  std::uint32_t add_wedge(std::uint32_t point);
  void copy_values(std::uint32_t from, std::uint32_t to);
  std::uint32_t add_face(std::array<std::uint32_t, 3> wedges, std::uint16_t group);
  Point& point(std::uint32_t p) { return points_[p]; }
  std::int32_t* value(std::size_t k, std::uint32_t wedge) {
    return values_[k].data() + wedge * static_cast<std::size_t>(components_[k]);
  }
  std::uint32_t degree(std::uint32_t point) const { return ring_[point].degree; }
  std::uint32_t point_at(std::uint32_t face, std::uint32_t corner) const {
    return faces_[face].point[corner % 3];
  }
  std::uint32_t wedge_at(std::uint32_t face, std::uint32_t corner) const {
    return faces_[face].wedge[corner % 3];
  }
  /// Calls visit(face, corner) for the corners at a point.
  void each_corner(std::uint32_t point, auto&& visit) const {
    for (std::uint32_t c = ring_[point].head; c != kNoIndex; c = next_of(c)) visit(c / 3, c % 3);
  }
  /// The corners at a point, sorted into fans: open fans first, each in the order of its first corner in
  /// the point's list.
  void gather(std::uint32_t point, std::vector<Corner>& corners, std::vector<Fan>& fans);
  /// Asks memory for what a split of the point will read: first for the head of its list of corners, then for
  /// the first corner's face, then corner by corner for the point beside it and the next face. Each call
  /// needs what the one before it has brought. The last two give the corner whose face was asked for, which
  /// may be none.
  void look_ahead(std::uint32_t point) const { ask_memory(&ring_[point]); }
  std::uint32_t look_at_first(std::uint32_t point) const { return asked_for(ring_[point].head); }
  std::uint32_t look_beside(std::uint32_t corner) const;
  /// Gives the corners that move their target wedges, all of point `to`, which had no corner before.
  /// `corners` are those of gather(from); both points' corners stand in that order afterwards.
  void distribute(std::uint32_t from, std::uint32_t to, const std::vector<Corner>& corners);

 private:
  // What is asked together lies together: neighbours on a large mesh are anywhere in memory.
  struct Face {
    std::array<std::uint32_t, 3> wedge, point, next;  // the next corner (3 * face + corner) at its point
  };
  struct Ring {
    std::uint32_t head = kNoIndex, degree = 0;  // first corner, number of corners
    // Scratch of gather(): the first unsorted corner with this a, and how many have this b.
    std::uint32_t first_a = kNoIndex, count_b = 0;
  };
  std::uint32_t& next_of(std::uint32_t corner) { return faces_[corner / 3].next[corner % 3]; }
  std::uint32_t next_of(std::uint32_t corner) const { return faces_[corner / 3].next[corner % 3]; }
  /// Asks for the corner's face. Gives the corner, which may be none.
  std::uint32_t asked_for(std::uint32_t corner) const {
    if (corner == kNoIndex) return corner;
    ask_memory(&faces_[corner / 3].wedge);
    ask_memory(&faces_[corner / 3].next[2]);
    return corner;
  }
  void gather_fan(std::uint32_t start, std::vector<Corner>& corners, std::vector<Fan>& fans);
  std::vector<Point> points_;
  std::vector<std::uint32_t> wedge_point_;
  std::vector<Face> faces_;
  std::vector<std::uint16_t> face_group_;
  std::vector<int> components_;
  std::vector<std::vector<std::int32_t>> values_;
  std::vector<Ring> ring_;  // per point
  std::vector<Corner> loose_;
  std::vector<std::uint32_t> chain_;
  std::vector<bool> taken_;
};

}  // namespace texmesh
