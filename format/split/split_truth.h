#pragma once
#include <array>
#include <compare>
#include <cstdint>
#include <vector>

#include "format/base/no_index.h"
#include "format/split/split_ahead.h"
#include "format/split/split_mesh.h"
#include "format/split/split_source.h"

namespace texmesh {

/// What the writer knows and the reader must be told: the source, how its numbers stand to the stream's, and
/// the split or face under way.
class SplitTruth {
 public:
  SplitTruth(const SplitSource& source, const SplitMesh& mesh)
      : source_(source),
        mesh_(mesh),
        stream_point_(source.points.size(), kNoIndex),
        stream_face_(source.face_group.size(), kNoIndex),
        early_(source.points.size(), kNoIndex) {}

  // ---- chapters

  void begin_chapter(const SplitSource::Chapter& chapter);

  /// Asks memory for what a split of the point will read. `corner`: one at the point, which may be none.
  void look_ahead(std::uint32_t v, SplitStep step, std::uint32_t corner) const;
  bool is_ready(std::uint32_t v) const { return ready_[v] != kNoIndex; }
  void begin_split(std::uint32_t v, std::uint32_t u);
  void check_moves(std::size_t found) const;
  void end_split();

  // ---- corners that move

  bool moves(std::uint32_t face) const { return move_[face] != kNoIndex; }
  bool is_target(std::uint32_t face, std::uint32_t w) const { return source_wedge_[w] == move_[face]; }
  bool is_any_target(std::uint32_t face, const std::vector<std::uint32_t>& wedges) const;
  bool target_equals(std::uint32_t face, std::uint32_t w) const;
  void bind_target(std::uint32_t face, std::uint32_t w) { bind_wedge(w, move_[face]); }

  // ---- the face under way; roles are parent, child, third, or start, end, third of a patch's edge

  bool choose_born_face(std::uint32_t x);
  bool choose_any_born_face() { return !remaining_.empty() && set_born_face(0); }
  std::uint32_t third_point() const { return wanted_point(2); }
  bool is_forward(std::uint32_t) const { return forward_; }
  bool is_wanted(std::uint32_t role, std::uint32_t w) const { return source_wedge_[w] == wanted_[role]; }
  bool fits_better(std::uint32_t v, std::uint32_t x, std::uint32_t v2, std::uint32_t x2) const;
  std::uint32_t wanted_group() const { return source_.face_group[face_]; }
  std::uint32_t wanted_point(std::uint32_t role) const {
    return stream_point_[source_.wedge_point[wanted_[role]]];
  }
  void bind_wanted(std::uint32_t role, std::uint32_t w) { bind_wedge(w, wanted_[role]); }
  void bind_wanted_point(std::uint32_t role, std::uint32_t p) {
    bind_point(p, source_.wedge_point[wanted_[role]]);
  }
  void bind_face(std::uint32_t face);

  // ---- patches

  void choose_seed_face();
  bool choose_face_at_gate(std::uint32_t a, std::uint32_t b);

  // ---- values

  SplitMesh::Point place(std::uint32_t p) const { return source_.points[source_point_[p]]; }
  const std::int32_t* value(std::size_t k, std::uint32_t w) const {
    return source_value(k, source_wedge_[w]);
  }
  bool equal(std::size_t k, std::uint32_t a, std::uint32_t b) const {
    return equal_source(k, source_wedge_[a], source_wedge_[b]);
  }

 private:
  struct Edge {
    std::array<std::uint32_t, 2> points;
    std::uint32_t face, corner;
    friend auto operator<=>(const Edge&, const Edge&) = default;
  };
  void look_at_split(std::uint32_t number, SplitStep step) const;
  void make_ready(std::uint32_t split);
  void bind_point(std::uint32_t p, std::uint32_t source);
  void bind_wedge(std::uint32_t w, std::uint32_t source);
  std::uint32_t third_of(const SplitSource::Face& face) const;
  std::uint32_t moved_face(std::uint32_t move) const;
  bool set_born_face(std::size_t i);
  void sort_patch();
  void set_patch_face(std::uint32_t index, std::uint32_t corner);
  const std::int32_t* source_value(std::size_t k, std::uint32_t wedge) const {
    return source_.values[k].data() +
           wedge * static_cast<std::size_t>(split_components(source_.attributes[k].kind));
  }
  bool equal_source(std::size_t k, std::uint32_t a, std::uint32_t b) const;

  const SplitSource& source_;
  const SplitMesh& mesh_;
  std::vector<std::uint32_t> stream_point_, stream_face_;   // by source number
  std::vector<std::uint32_t> source_point_, source_wedge_;  // by stream number
  const SplitSource::Chapter* chapter_ = nullptr;
  /// Per point of the stream: the split it is parent of that may come now. `early_`: per source point that
  /// the stream does not have yet.
  std::vector<std::uint32_t> ready_, early_;
  std::vector<std::uint32_t> waiting_, first_, after_;
  std::vector<std::uint32_t> move_;  // per face of the stream: its wedge at the child of the split under way
  struct Born {
    std::uint32_t number, third;  // in Chapter::born; the source's point beside parent and child
  };
  std::vector<Born> remaining_;
  std::uint32_t number_ = 0, parent_ = kNoIndex, child_ = kNoIndex, face_ = 0;
  std::array<std::uint32_t, 3> wanted_{};
  bool forward_ = false;
  std::vector<Edge> edges_;
  std::vector<bool> patch_coded_;
  std::size_t next_seed_ = 0;
};

}  // namespace texmesh
