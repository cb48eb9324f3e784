#pragma once

#include "format/split/split_element_codec.h"

namespace texmesh {

// The order of decisions of mesh/stream.bin, for writer and reader. SplitQueue says which point is asked
// next. SplitMoveCodec and SplitVertexCodec code one split: which faces and corners move to the new vertex,
// and which faces are born. SplitPatchCodec codes faces that no split makes. SplitCodec puts them together.

/// Steps by which memory is asked for what a split of a point will read: of the mesh the corners at the
/// point, one after the other, and of the writer's knowledge what the split makes and moves.
enum class SplitStep : std::uint8_t {
  kPoint,      // where the corners begin; which split it is
  kSplit,      // the first corner; the split
  kLists,      // the second corner; the split's points and lists
  kListed,     // the third; what the lists name
  kFollowing,  // the fourth; what that leads to
  kFifthCorner,
  kSixthCorner,
  kSeventhCorner,
  kCount
};
using SplitAhead = LookAhead<SplitStep, 3>;

/// Points to be asked whether they split now: first come, first served. A point stands in the queue once.
class SplitQueue {
 public:
  explicit SplitQueue(const SplitMesh& mesh) : mesh_(mesh) {}

  /// Before the first block of a scale.
  void clear() {
    queue_.clear();
    next_ = 0;
    no_split_since_refill_ = false;
    std::fill(queued_.begin(), queued_.end(), false);
    std::fill(history_.begin(), history_.end(), std::uint8_t{0});
  }
  void push(std::uint32_t point) {
    if (point >= queued_.size()) {
      queued_.resize(mesh_.points().size(), false);
      history_.resize(mesh_.points().size(), 0);
    }
    if (queued_[point]) return;
    queued_[point] = true;
    queue_.push_back(point);
  }
  /// The next point. An empty queue is filled with all points of the mesh; FormatError when not one of them
  /// split since it was filled the last time.
  std::uint32_t pop() {
    if (next_ == queue_.size()) refill();
    const std::uint32_t point = queue_[next_++];
    queued_[point] = false;
    return point;
  }
  /// The point that is popped after `more` others, of whose history memory is asked for; kNoIndex where the
  /// queue ends before.
  std::uint32_t look_ahead(std::size_t more) const {
    if (next_ + more >= queue_.size()) return kNoIndex;
    const std::uint32_t point = queue_[next_ + more];
    ask_memory(&history_[point]);
    return point;
  }
  std::size_t refusals(std::uint32_t point) const { return history_[point] & 3u; }  // at most 3
  bool has_split(std::uint32_t point) const { return (history_[point] & kHasSplit) != 0; }
  void note_refusal(std::uint32_t point) {
    if (refusals(point) < 3) ++history_[point];
  }
  void note_split(std::uint32_t point) {
    history_[point] = kHasSplit;
    no_split_since_refill_ = false;
  }
  /// Frees the memory of points that were popped.
  void compact() {
    if (next_ <= 65536 || next_ * 2 <= queue_.size()) return;
    queue_.erase(queue_.begin(), queue_.begin() + static_cast<std::ptrdiff_t>(next_));
    next_ = 0;
  }

 private:
  static constexpr std::uint8_t kHasSplit = 4;
  void refill() {
    if (no_split_since_refill_) fail_split_stream("S19", "a split among all points", "none");
    no_split_since_refill_ = true;
    queue_.clear();
    next_ = 0;
    for (std::uint32_t p = 0; p < mesh_.points().size(); ++p) push(p);
    if (queue_.empty()) fail_split_stream("S19", "points to split", "none");
  }

  const SplitMesh& mesh_;
  std::vector<std::uint32_t> queue_;
  std::size_t next_ = 0;
  bool no_split_since_refill_ = false;
  std::vector<bool> queued_;  // per point
  // Per point: refusals 0 to 3, + kHasSplit after a split in this chapter.
  std::vector<std::uint8_t> history_;
};

/// Which corners of a split's parent go to the child, and which wedges they get there.
template <class Channel>
class SplitMoveCodec {
 public:
  using Corner = SplitMesh::Corner;
  explicit SplitMoveCodec(SplitElementCodec<Channel>& elements)
      : elements_(elements),
        mesh_(elements.mesh),
        channel_(elements.channel),
        models_(elements.models),
        site_(elements.site) {}

  void code() {
    for (std::size_t f = 0; f < site_.fans.size(); ++f) code_moves(site_.fans[f], f);
    channel_.update_truth([&](auto& t) {
      t.check_moves(static_cast<std::size_t>(std::ranges::count(site_.corners, true, &Corner::moves)));
    });
    mapped_.resize(mesh_.wedge_point().size(), 0);
    target_.resize(mesh_.wedge_point().size(), 0);
    for (Corner& c : site_.corners)
      if (c.moves) code_target(c);
  }
  /// The child's wedge that a corner with this wedge got first; kNoIndex when no such corner moved.
  std::uint32_t target_of(std::uint32_t wedge) const {
    return wedge < mapped_.size() && mapped_[wedge] == split_number() ? target_[wedge] : kNoIndex;
  }

 private:
  std::size_t valence(std::uint32_t p) const { return std::clamp<std::uint32_t>(mesh_.degree(p), 4, 8) - 4; }
  std::uint32_t split_number() const { return site_.child + 1; }  // never 0

  /// Which corners of a fan go to the child: usually one run of them.
  void code_moves(const SplitMesh::Fan& fan, std::size_t fan_number) {
    const std::uint32_t n = fan.end - fan.begin, ring = std::min<std::uint32_t>(n, 10);
    const std::size_t open = fan.closed ? 0 : 1;
    std::uint32_t turns = 0, run = 1;
    bool moving = false;
    for (std::uint32_t i = 0; i < n; ++i) {
      Corner& c = site_.corners[fan.begin + i];
      const auto turns_here = [&](auto& t) { return t.moves(c.face) != moving; };
      const std::size_t side = moving ? 1 : 0;
      bool turn = false;
      if (i == 0) {
        BitModel& m = models_.first[std::min<std::size_t>(n, SplitModels::kLeft - 1)][fan_number > 0];
        moving = channel_.bit(m, [&](auto& t) { return t.moves(c.face); });
      } else if (turns == 0) {
        const std::size_t left = std::min<std::size_t>(n - i, SplitModels::kLeft - 1);
        turn = channel_.bit(models_.turn[open][side][left][valence(c.a)], turns_here);
      } else if (turns == 1) {
        const std::size_t long_run = std::min<std::size_t>(run, SplitModels::kRun) - 1;
        const std::size_t size = std::clamp<std::uint32_t>(ring, 3, 10) - 3;
        turn = channel_.bit(models_.turn_back[open][side][long_run][size][valence(c.a)], turns_here);
      } else {
        turn = channel_.bit(models_.turn_again[open][side], turns_here);
      }
      if (turn) {
        moving = !moving;
        ++turns;
        run = 0;
      }
      ++run;
      c.moves = moving;
    }
  }

  /// The child's wedge at a corner that moves: the one that corners of the same wedge got before.
  void code_target(Corner& c) {
    if (stays_split_ != split_number()) note_staying_wedges();
    const std::uint32_t expected = target_of(c.wedge);
    const bool known = expected != kNoIndex;
    const auto is = [&](std::uint32_t w) { return [&c, w](auto& t) { return t.is_target(c.face, w); }; };
    const bool as_expected = channel_.bit(models_.target_expected[known], [&](auto& t) {
      return known ? t.is_target(c.face, expected) : !t.is_any_target(c.face, site_.child_wedges);
    });
    c.target = kNoIndex;
    if (as_expected && known) {
      c.target = expected;
    } else if (!as_expected) {
      for (std::uint32_t w : site_.child_wedges)
        if (w != expected && channel_.bit(models_.listed, is(w))) {
          c.target = w;
          break;
        }
    }
    if (c.target == kNoIndex) c.target = add_target(c);
    if (!known) {
      mapped_[c.wedge] = split_number();
      target_[c.wedge] = c.target;
    }
  }
  void note_staying_wedges() {
    stays_split_ = split_number();
    stays_.resize(mesh_.wedge_point().size(), 0);
    for (const Corner& c : site_.corners)
      if (!c.moves) stays_[c.wedge] = stays_split_;
  }
  std::uint32_t add_target(const Corner& c) {
    const bool lost = stays_[c.wedge] != stays_split_;
    const bool copied =
        channel_.bit(models_.target_copied[lost], [&](auto& t) { return t.target_equals(c.face, c.wedge); });
    const std::uint32_t w = elements_.add_wedge(site_.child, !copied);
    if (copied) mesh_.copy_values(c.wedge, w);
    site_.child_wedges.push_back(w);
    channel_.update_truth([&](auto& t) { t.bind_target(c.face, w); });
    return w;
  }

  SplitElementCodec<Channel>& elements_;
  SplitMesh& mesh_;
  Channel& channel_;
  SplitModels& models_;
  SplitSite& site_;
  // Per wedge, each with the number of the split for which it holds:
  std::vector<std::uint32_t> mapped_, target_;  // the child's wedge in place of the parent's
  std::vector<std::uint32_t> stays_;            // some corner keeps the wedge
  std::uint32_t stays_split_ = 0;
};

/// One vertex split: corners of the parent go to the child, and faces are born between the two.
template <class Channel>
class SplitVertexCodec {
 public:
  using Corner = SplitMesh::Corner;
  explicit SplitVertexCodec(SplitElementCodec<Channel>& elements)
      : elements_(elements),
        mesh_(elements.mesh),
        channel_(elements.channel),
        models_(elements.models),
        site_(elements.site),
        moves_(elements) {}

  /// Splits the point `v`; returns the new one. The site's corners are those that `v` had.
  std::uint32_t split(std::uint32_t v) {
    elements_.steps.add(mesh_.degree(v));
    mesh_.gather(v, site_.corners, site_.fans);
    const std::uint32_t u = elements_.add_point();
    site_.parent = v, site_.child = u;
    site_.child_wedges.clear();
    elements_.values.clear_fresh();
    channel_.update_truth([&](auto& t) { t.begin_split(v, u); });
    moves_.code();
    mesh_.distribute(v, u, site_.corners);
    for (const SplitMesh::Fan& fan : site_.fans) code_new_faces(fan);
    while (channel_.bit(models_.extra_face, [](auto& t) { return t.choose_any_born_face(); }))
      code_extra_face();
    elements_.values.code_child_point();
    elements_.values.code_fresh_wedges();
    channel_.finish_point(mesh_, u);
    site_.parent = site_.child = kNoIndex;
    channel_.update_truth([&](auto& t) { t.end_split(); });
    return u;
  }

 private:
  void code_new_faces(const SplitMesh::Fan& fan) {
    if (fan.closed) {
      std::uint32_t last = fan.end - 1;
      for (std::uint32_t i = fan.begin; i < fan.end; last = i++) code_edge(last, i);
    } else {
      code_edge(kNoIndex, fan.begin);
      for (std::uint32_t i = fan.begin + 1; i < fan.end; ++i) code_edge(i - 1, i);
      code_edge(fan.end - 1, kNoIndex);
    }
  }
  /// New faces at the edge between two corners of a fan, or at an end of an open one.
  void code_edge(std::uint32_t last, std::uint32_t next) {
    const bool inside = last != kNoIndex && next != kNoIndex;
    const Corner& c = site_.corners[next != kNoIndex ? next : last];
    const std::uint32_t x = next != kNoIndex ? c.a : c.b;
    std::size_t kind = c.moves ? 3 : 2;
    if (inside) kind = site_.corners[last].moves != site_.corners[next].moves ? 1 : 0;
    const auto has_face = [&](std::size_t before) {
      BitModel& model = models_.more_faces[kind][std::min<std::size_t>(before, 1)];
      return channel_.bit(model, [&](auto& t) { return t.choose_born_face(x); });
    };
    for (std::size_t n = 0; has_face(n); ++n) {
      elements_.steps.add(1);
      code_face(x, last, next);
    }
  }
  /// One new face of parent, child and x.
  void code_face(std::uint32_t x, std::uint32_t last, std::uint32_t next) {
    const std::vector<Corner>& corners = site_.corners;
    const bool usual = next != kNoIndex ? corners[next].moves : !corners[last].moves;
    const bool flipped = channel_.bit(models_.flipped, [&](auto& t) { return t.is_forward(x) != usual; });
    std::uint32_t moving = kNoIndex, staying = kNoIndex;  // corners beside the new face
    for (std::uint32_t i : {next, last})
      if (i != kNoIndex) (corners[i].moves ? moving : staying) = i;
    const auto third = [&](std::uint32_t i) {
      return i == kNoIndex ? kNoIndex
                           : mesh_.wedge_at(corners[i].face, corners[i].corner + (i == next ? 1 : 2));
    };
    const std::uint32_t mx = third(moving), sx = third(staying);
    std::size_t seam = 0;
    bool beside_moving = moving != kNoIndex;
    if (moving != kNoIndex && staying != kNoIndex) {
      const std::uint32_t mw = corners[moving].wedge, sw = corners[staying].wedge;
      const bool wedge = mw != sw, far = mx != sx;
      if (wedge || far) {
        seam = 1;
        BitModel& model = models_.beside_moving[!far ? 0 : wedge ? 2 : 1];
        beside_moving = channel_.bit(model, [&](auto& t) { return t.fits_better(mw, mx, sw, sx); });
      }
    }
    const Corner& beside = corners[beside_moving ? moving : staying];
    const std::uint32_t child = beside_moving ? beside.target : moves_.target_of(beside.wedge);
    finish_face(x, usual != flipped, {beside.wedge, child, beside_moving ? mx : sx}, seam, beside.face);
  }
  /// A face beside none of the parent's corners.
  void code_extra_face() {
    const std::uint32_t x =
        elements_.code_index(mesh_.points().size(), [](auto& t) { return t.third_point(); });
    if (x == site_.parent || x == site_.child) fail_split_stream("S22", "three points of a face", "two");
    const bool forward = channel_.raw(1, [&](auto& t) { return t.is_forward(x) ? 1u : 0u; }) != 0;
    finish_face(x, forward, {kNoIndex, kNoIndex, kNoIndex}, 1, kNoIndex);
  }
  void finish_face(std::uint32_t x, bool forward, std::array<std::uint32_t, 3> expected, std::size_t seam,
                   std::uint32_t beside) {
    auto& model = models_.corner_expected;
    const std::uint32_t v = elements_.code_wedge(0, expected[0], model[0][seam], site_.parent);
    const std::uint32_t u = elements_.code_wedge(1, expected[1], model[1][seam], site_.child);
    const std::uint32_t w = elements_.code_wedge(2, expected[2], model[2][seam], x);
    const std::uint16_t group = elements_.code_group(beside);
    elements_.add_face(forward ? std::array{v, w, u} : std::array{v, u, w}, group);
  }

  SplitElementCodec<Channel>& elements_;
  SplitMesh& mesh_;
  Channel& channel_;
  SplitModels& models_;
  SplitSite& site_;
  SplitMoveCodec<Channel> moves_;
};

/// Faces that no split makes: the coarsest scale, and pieces that a finer scale adds. From a seed the patch
/// grows over its open edges, the gates.
template <class Channel>
class SplitPatchCodec {
 public:
  using Corner = SplitMesh::Corner;
  explicit SplitPatchCodec(SplitElementCodec<Channel>& elements)
      : elements_(elements),
        mesh_(elements.mesh),
        channel_(elements.channel),
        models_(elements.models),
        site_(elements.site) {}

  void code_faces(std::uint32_t count) {
    gates_.clear();
    while (count > 0) {
      if (gates_.empty()) {
        code_seed();
        --count;
        continue;
      }
      const Gate gate = gates_.back();
      gates_.pop_back();
      if (code_face_at_gate(gate)) --count;
    }
  }

 private:
  struct Gate {
    std::uint32_t face, corner;  // the edge from this corner to the next
  };
  /// The two ends of a gate: the corner beside the missing face, and the size of its fan as a context.
  struct GateEnd {
    Corner outer;
    std::size_t size = 0;
  };

  void code_seed() {
    elements_.values.clear_fresh();
    channel_.update_truth([](auto& t) { t.choose_seed_face(); });
    std::array<std::uint32_t, 3> wedges{}, points{};
    for (std::uint32_t k = 0; k < 3; ++k) {
      const bool exists = !mesh_.points().empty() && channel_.bit(models_.seed_exists, [k](auto& t) {
        return t.wanted_point(k) != kNoIndex;
      });
      if (exists) {
        points[k] = elements_.code_index(mesh_.points().size(), [k](auto& t) { return t.wanted_point(k); });
        if (k > 0 && (points[k] == points[0] || points[k] == points[k - 1]))
          fail_split_stream("S22", "three points of a face", "two");
        wedges[k] = elements_.code_wedge(k, kNoIndex, models_.listed, points[k]);
      } else {
        const std::uint32_t before =
            k > 0 ? points[0] : static_cast<std::uint32_t>(mesh_.points().size()) - 1;
        points[k] = add_point(k, before == kNoIndex ? SplitMesh::Point{} : mesh_.points()[before]);
        wedges[k] = add_wedge(k, points[k]);
      }
    }
    add_face(wedges, kNoIndex);
  }

  std::uint32_t add_point(std::uint32_t role, SplitMesh::Point prediction) {
    const std::uint32_t p = elements_.add_point();
    channel_.update_truth([&](auto& t) { t.bind_wanted_point(role, p); });
    elements_.values.code_point(p, prediction);
    return p;
  }
  std::uint32_t add_wedge(std::uint32_t role, std::uint32_t p) {
    const std::uint32_t w = elements_.add_wedge(p, true);
    channel_.update_truth([&](auto& t) { t.bind_wanted(role, w); });
    return w;
  }
  void add_face(std::array<std::uint32_t, 3> wedges, std::uint32_t beside) {
    const std::uint32_t face = elements_.add_face(wedges, elements_.code_group(beside));
    elements_.values.code_fresh_wedges();
    for (std::uint32_t k = 0; k < 3; ++k) gates_.push_back({face, k});
  }

  /// The fan around `point` that holds a corner of `face`; its corners are the site's.
  SplitMesh::Fan fan_with_face(std::uint32_t point, std::uint32_t face) {
    elements_.steps.add(mesh_.degree(point));
    mesh_.gather(point, site_.corners, site_.fans);
    for (const SplitMesh::Fan& fan : site_.fans)
      for (std::uint32_t i = fan.begin; i < fan.end; ++i)
        if (site_.corners[i].face == face) return fan;
    return {};
  }
  static std::size_t fan_size(const SplitMesh::Fan& fan) {
    return std::min<std::size_t>(fan.end - fan.begin, 8) - 1;
  }

  /// Adds the face behind an open edge; false when there is none.
  bool code_face_at_gate(const Gate& gate) {
    const std::uint32_t face = gate.face, wa = mesh_.wedge_at(face, gate.corner),
                        wb = mesh_.wedge_at(face, gate.corner + 1);
    const std::uint32_t a = mesh_.point_at(face, gate.corner), b = mesh_.point_at(face, gate.corner + 1),
                        d = mesh_.point_at(face, gate.corner + 2);
    const SplitMesh::Fan at_a = fan_with_face(a, face);
    // Otherwise the edge has two faces already.
    if (at_a.closed || site_.corners[at_a.begin].face != face) return false;
    const GateEnd left{site_.corners[at_a.end - 1], fan_size(at_a)};
    const SplitMesh::Fan at_b = fan_with_face(b, face);
    const GateEnd right{site_.corners[at_b.begin], fan_size(at_b)};
    BitModel& model = models_.gate_open[left.size][right.size];
    if (!channel_.bit(model, [&](auto& t) { return t.choose_face_at_gate(a, b); })) return false;
    elements_.values.clear_fresh();
    const std::uint32_t new_b = elements_.code_wedge(1, wb, models_.patch_expected[0], b);
    const std::uint32_t new_a = elements_.code_wedge(0, wa, models_.patch_expected[1], a);
    const std::uint32_t c = code_third_corner({a, b, d}, left, right);
    add_face({new_b, new_a, c}, face);
    return true;
  }
  /// The third wedge of the face behind the gate; `points` are those of the face before it, the gate's first.
  std::uint32_t code_third_corner(std::array<std::uint32_t, 3> points, const GateEnd& left,
                                  const GateEnd& right) {
    const auto [a, b, d] = points;
    if (channel_.bit(models_.third_new[left.size][right.size],
                     [](auto& t) { return t.wanted_point(2) == kNoIndex; })) {
      SplitMesh::Point guess;
      for (std::size_t k = 0; k < 3; ++k)
        guess[k] = mesh_.points()[a][k] + mesh_.points()[b][k] - mesh_.points()[d][k];
      return add_wedge(2, add_point(2, guess));
    }
    const auto is = [](std::uint32_t p) { return [p](auto& t) { return t.wanted_point(2) == p; }; };
    const Corner &l = left.outer, &r = right.outer;
    if (l.b != b && channel_.bit(models_.third_left[left.size][right.size], is(l.b)))
      return elements_.code_wedge(2, mesh_.wedge_at(l.face, l.corner + 2), models_.patch_expected[2], l.b);
    if (r.a != a && r.a != l.b && channel_.bit(models_.third_right, is(r.a)))
      return elements_.code_wedge(2, mesh_.wedge_at(r.face, r.corner + 1), models_.patch_expected[3], r.a);
    const std::uint32_t p =
        elements_.code_index(mesh_.points().size(), [](auto& t) { return t.wanted_point(2); });
    if (p == a || p == b) fail_split_stream("S22", "three points of a face", "two");
    return elements_.code_wedge(2, kNoIndex, models_.listed, p);
  }

  SplitElementCodec<Channel>& elements_;
  SplitMesh& mesh_;
  Channel& channel_;
  SplitModels& models_;
  SplitSite& site_;
  std::vector<Gate> gates_;
};

/// The order of decisions that writer and reader share. Channel::bit(model, truth) codes a decision:
/// the writer's channel asks truth(its knowledge) and writes the answer, the reader's reads it and
/// never calls truth.
template <class Channel>
class SplitCodec {
 public:
  SplitCodec(SplitMesh& mesh, Channel& channel, std::size_t groups, SplitLimits limits)
      : elements_(mesh, channel, groups, limits), queue_(mesh), vertices_(elements_), patches_(elements_) {
    ahead_.fill(kNoIndex);
  }
  // The parts refer to each other.
  SplitCodec(const SplitCodec&) = delete;
  SplitCodec& operator=(const SplitCodec&) = delete;

  /// Before the first block of a scale.
  void begin_chapter() { queue_.clear(); }
  /// A block of `count` faces that no split makes.
  void code_patch(std::uint32_t count) { patches_.code_faces(count); }
  /// A block of `count` vertex splits.
  void code_splits(std::uint32_t count) {
    while (count > 0) {
      const std::uint32_t v = queue_.pop();
      look_ahead();
      elements_.steps.add(1);
      if (!code_answer(v)) {
        queue_.note_refusal(v);
        continue;
      }
      queue_.note_split(v);
      const std::uint32_t u = vertices_.split(v);
      queue_.push(v);
      queue_.push(u);
      for (const SplitMesh::Corner& c : elements_.site.corners) {
        queue_.push(c.a);
        queue_.push(c.b);
      }
      --count;
    }
    queue_.compact();
  }

 private:
  /// For the points that the queue gives next.
  void look_ahead() {
    ++popped_;
    SplitAhead::each_step([&](SplitStep step, std::size_t ahead) {
      const std::uint32_t p = queue_.look_ahead(ahead - 1);
      std::uint32_t& corner = ahead_[(popped_ + ahead) % ahead_.size()];
      if (step == SplitStep::kPoint) corner = kNoIndex;
      if (p == kNoIndex) return;
      if (step == SplitStep::kPoint)
        elements_.mesh.look_ahead(p);
      else if (step == SplitStep::kSplit)
        corner = elements_.mesh.look_at_first(p);
      else if (corner != kNoIndex)
        corner = elements_.mesh.look_beside(corner);
      elements_.channel.update_truth([&](auto& t) { t.look_ahead(p, step, corner); });
    });
  }
  /// Whether the point splits now.
  bool code_answer(std::uint32_t v) {
    const auto degree = std::min<std::uint32_t>(elements_.mesh.degree(v), SplitModels::kDegrees - 1);
    BitModel& model =
        elements_.models.ask[degree][queue_.refusals(v)][queue_.has_split(v) ? 1 : 0][last_answer_];
    last_answer_ = elements_.channel.bit(model, [&](auto& t) { return t.is_ready(v); });
    return last_answer_;
  }

  SplitElementCodec<Channel> elements_;
  SplitQueue queue_;
  SplitVertexCodec<Channel> vertices_;
  SplitPatchCodec<Channel> patches_;
  bool last_answer_ = false;
  // The corner that look_ahead() has come to, by pops; a power of two is fast.
  std::array<std::uint32_t, std::bit_ceil(SplitAhead::kFarthest + 1)> ahead_{};
  std::size_t popped_ = 0;
};

}  // namespace texmesh
