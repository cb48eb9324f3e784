#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "format/base/errors.h"
#include "format/base/no_index.h"
#include "format/split/split_coder.h"
#include "format/split/split_mesh.h"
#include "format/split/split_stream.h"

namespace texmesh {

inline constexpr const char* kSplitStreamName = "mesh/stream.bin";

/// Probabilities of the connectivity part; they go on learning through the whole stream.
struct SplitModels {
  static constexpr std::uint8_t kLimit = 200;
  static constexpr int kDegrees = 14, kAsks = 4, kLeft = 12, kRun = 7, kRing = 8, kValence = 5;
  using Pair = std::array<BitModel, 2>;
  std::array<std::array<std::array<Pair, 2>, kAsks>, kDegrees> ask;  // [degree][refusals][split before][last]
  std::array<Pair, kLeft> first;                                     // [corners][not the first fan]
  // A fan's corners change from staying to moving and back; [open][moving] ...
  std::array<std::array<std::array<std::array<BitModel, kValence>, kLeft>, 2>, 2> turn;  // [left][valence]
  std::array<std::array<std::array<std::array<std::array<BitModel, kValence>, kRing>, kRun>, 2>, 2>
      turn_back;                                      // [run][ring][valence]
  std::array<Pair, 2> turn_again;                     // [open][moving]
  std::array<BitModel, 2> target_expected;            // [has one]
  std::array<BitModel, 2> target_copied;              // [the parent loses the wedge]
  BitModel listed;                                    // this wedge of a list
  std::array<std::array<BitModel, 2>, 4> more_faces;  // [kind of edge][has one]
  BitModel flipped, extra_face, same_group;
  std::array<BitModel, 3> beside_moving;                   // [what differs]
  std::array<std::array<BitModel, 2>, 3> corner_expected;  // [parent, child, third][seam]
  // Patches:
  BitModel seed_exists;
  std::array<std::array<BitModel, 8>, 8> gate_open, third_new, third_left;  // [fan at start][fan at end]
  BitModel third_right;
  std::array<BitModel, 4> patch_expected;  // [corner of the edge; third beside the start, beside the end]
};

/// The walk that writer and reader share. Channel::bit(model, truth) codes a decision: the writer's asks
/// truth(its knowledge) and writes the answer, the reader's reads it and never calls truth.
template <class Channel>
class SplitCodec {
 public:
  using Corner = SplitMesh::Corner;
  static constexpr std::uint32_t kNone = kNoIndex;

  SplitCodec(SplitMesh& mesh, Channel& channel, std::size_t groups, SplitLimits limits)
      : mesh_(mesh), channel_(channel), groups_(groups), limits_(limits) {}

  /// Before the first block of a scale.
  void begin_chapter() {
    queue_.clear();
    at_ = 0;
    fruitless_ = false;
    std::fill(queued_.begin(), queued_.end(), false);
    std::fill(asks_.begin(), asks_.end(), std::uint8_t{0});
  }

  void splits(std::uint32_t count) {
    while (count > 0) {
      if (at_ == queue_.size()) refill();
      const std::uint32_t v = queue_[at_++];
      queued_[v] = false;
      spend(1);
      std::uint8_t& asks = asks_[v];
      const auto degree = std::min<std::uint32_t>(mesh_.degree(v), SplitModels::kDegrees - 1);
      BitModel& model = models_.ask[degree][asks & 3u][(asks >> 2) & 1u][last_answer_];
      last_answer_ = channel_.bit(model, [&](auto& t) { return t.is_ready(v); });
      if (!last_answer_) {
        if ((asks & 3u) < 3) ++asks;
        continue;
      }
      asks = 4;
      split(v);
      --count;
      fruitless_ = false;
    }
    if (at_ > 65536 && at_ * 2 > queue_.size()) {
      queue_.erase(queue_.begin(), queue_.begin() + static_cast<std::ptrdiff_t>(at_));
      at_ = 0;
    }
  }

  void patch(std::uint32_t count) {
    gates_.clear();
    while (count > 0) {
      if (gates_.empty()) {
        seed_face();
        --count;
        continue;
      }
      const Gate gate = gates_.back();
      gates_.pop_back();
      if (pass_gate(gate)) --count;
    }
  }

 private:
  struct Gate {
    std::uint32_t face, corner;  // the edge from this corner to the next
  };
  [[noreturn]] static void fail(const char* expected, const std::string& found) {
    throw FormatError(kSplitStreamName, "", expected, found);
  }
  /// Work is bounded by the mesh: without this, few bytes could ask many points, or walk round one of huge
  /// degree, again and again.
  void spend(std::uint64_t work) {
    work_ += work;
    if (work_ > (std::uint64_t{1} << 20) + 256 * (mesh_.points().size() + mesh_.faces().size()))
      fail("splits that are found in reasonable time", "more steps than 256 per point and face");
  }

  // ---- points, wedges, faces

  std::uint32_t add_point() {
    if (mesh_.points().size() >= limits_.points)
      fail("points within the reader's limit", std::to_string(limits_.points));
    asks_.push_back(0);
    queued_.push_back(false);
    return mesh_.add_point();
  }
  std::uint32_t add_wedge(std::uint32_t point, bool pending) {
    if (mesh_.wedge_point().size() >= 3ull * limits_.faces)
      fail("wedges within the reader's limit", std::to_string(limits_.faces));
    const std::uint32_t w = mesh_.add_wedge(point);
    pending_.push_back(pending);
    listed_.push_back(0);
    mapped_.push_back(0);
    map_target_.push_back(0);
    if (pending) fresh_.push_back(w);
    return w;
  }
  std::uint32_t add_face(std::array<std::uint32_t, 3> wedges, std::uint16_t group) {
    if (mesh_.faces().size() >= limits_.faces)
      fail("faces within the reader's limit", std::to_string(limits_.faces));
    const std::uint32_t face = mesh_.add_face(wedges, group);
    channel_.know([&](auto& t) { t.bind_face(face); });
    return face;
  }
  std::uint16_t code_group(std::uint32_t beside) {
    if (beside != kNone) {
      const std::uint16_t group = mesh_.face_group()[beside];
      if (channel_.bit(models_.same_group, [&](auto& t) { return t.wanted_group() == group; })) return group;
    }
    const std::uint32_t group = number(groups_, [](auto& t) { return t.wanted_group(); });
    return static_cast<std::uint16_t>(group);
  }
  template <class Truth>
  std::uint32_t number(std::size_t count, Truth&& truth) {
    const std::uint32_t value = channel_.raw(std::bit_width(count - 1), truth);
    if (value >= count) fail("an index that exists", std::to_string(value));
    return value;
  }

  /// The wedge of corner `role` (0 parent or start, 1 child or end, 2 third) of the face under way at
  /// `point`: the expected one, one of the point's, or a new one.
  std::uint32_t code_wedge(std::uint32_t role, std::uint32_t expected, BitModel& model, std::uint32_t point) {
    auto is = [&](std::uint32_t w) { return [w, role](auto& t) { return t.is_wanted(role, w); }; };
    if (expected != kNone && channel_.bit(model, is(expected))) return expected;
    ++now_;
    if (expected != kNone) listed_[expected] = now_;
    std::uint32_t found = kNone;
    auto offer = [&](std::uint32_t w) {
      if (found != kNone || listed_[w] == now_) return;
      listed_[w] = now_;
      if (channel_.bit(models_.listed, is(w))) found = w;
    };
    if (point == parent_)
      for (const Corner& c : corners_) offer(c.wedge);
    if (point == child_) {
      for (std::uint32_t w : child_wedges_) offer(w);
    } else {
      spend(mesh_.degree(point));
      mesh_.each_corner(
          point, [&](std::uint32_t face, std::uint32_t corner) { offer(mesh_.wedge_at(face, corner)); });
    }
    if (found != kNone) return found;
    const std::uint32_t w = add_wedge(point, true);
    if (point == child_) child_wedges_.push_back(w);
    channel_.know([&](auto& t) { t.bind_wanted(role, w); });
    return w;
  }

  // ---- vertex splits

  void push(std::uint32_t p) {
    if (queued_[p]) return;
    queued_[p] = true;
    queue_.push_back(p);
  }
  void refill() {
    if (fruitless_) fail("a split among all points", "none");
    fruitless_ = true;
    queue_.clear();
    at_ = 0;
    for (std::uint32_t p = 0; p < mesh_.points().size(); ++p) push(p);
    if (queue_.empty()) fail("points to split", "none");
  }

  void split(std::uint32_t v) {
    spend(mesh_.degree(v));
    mesh_.gather(v, corners_, fans_);
    const std::uint32_t u = add_point();
    parent_ = v, child_ = u;
    child_wedges_.clear();
    fresh_.clear();
    channel_.know([&](auto& t) { t.begin_split(v, u); });
    for (std::size_t f = 0; f < fans_.size(); ++f) code_moves(fans_[f], f);
    channel_.know([&](auto& t) {
      t.check_moves(static_cast<std::size_t>(std::ranges::count(corners_, true, &Corner::moves)));
    });
    for (Corner& c : corners_)
      if (c.moves) code_target(c);
    mesh_.distribute(v, u, corners_);
    for (const SplitMesh::Fan& fan : fans_) code_new_faces(fan);
    while (channel_.bit(models_.extra_face, [](auto& t) { return t.take_any(); })) code_extra_face();
    predict_point(u);
    code_fresh_values();
    channel_.made(mesh_, u);
    parent_ = child_ = kNone;
    channel_.know([&](auto& t) { t.end_split(); });
    queue_around(v, u);
  }

  void queue_around(std::uint32_t v, std::uint32_t u) {
    push(v);
    push(u);
    for (const Corner& c : corners_) {
      push(c.a);
      push(c.b);
    }
  }

  std::size_t valence(std::uint32_t p) const { return std::clamp<std::uint32_t>(mesh_.degree(p), 4, 8) - 4; }

  /// Which corners of a fan go to the child: usually one run of them.
  void code_moves(const SplitMesh::Fan& fan, std::size_t fan_number) {
    const std::uint32_t n = fan.end - fan.begin, ring = std::min<std::uint32_t>(n, 10);
    const std::size_t open = fan.closed ? 0 : 1;
    std::uint32_t turns = 0, run = 1;
    bool moving = false;
    for (std::uint32_t i = 0; i < n; ++i) {
      Corner& c = corners_[fan.begin + i];
      auto turns_here = [&](auto& t) { return t.moves(c.face) != moving; };
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
    if (stays_now_ != split_number()) note_stays();
    const bool known = mapped_[c.wedge] == split_number();
    const std::uint32_t expected = known ? map_target_[c.wedge] : kNone;
    auto is = [&](std::uint32_t w) { return [&c, w](auto& t) { return t.is_target(c.face, w); }; };
    const bool as_expected = channel_.bit(models_.target_expected[known], [&](auto& t) {
      return known ? t.is_target(c.face, expected) : !t.is_any_target(c.face, child_wedges_);
    });
    c.target = kNone;
    if (as_expected && known) {
      c.target = expected;
    } else if (!as_expected) {
      for (std::uint32_t w : child_wedges_)
        if (w != expected && channel_.bit(models_.listed, is(w))) {
          c.target = w;
          break;
        }
    }
    if (c.target == kNone) c.target = new_target(c);
    if (!known) {
      mapped_[c.wedge] = split_number();
      map_target_[c.wedge] = c.target;
    }
  }
  std::uint32_t split_number() const { return child_ + 1; }  // 0 is never one
  void note_stays() {
    stays_now_ = split_number();
    stays_.resize(mesh_.wedge_point().size(), 0);
    for (const Corner& c : corners_)
      if (!c.moves) stays_[c.wedge] = stays_now_;
  }
  std::uint32_t new_target(const Corner& c) {
    const bool lost = stays_[c.wedge] != stays_now_;
    const bool copied =
        channel_.bit(models_.target_copied[lost], [&](auto& t) { return t.target_equals(c.face, c.wedge); });
    const std::uint32_t w = add_wedge(child_, !copied);
    stays_.resize(mesh_.wedge_point().size(), 0);
    if (copied) mesh_.copy_values(c.wedge, w);
    child_wedges_.push_back(w);
    channel_.know([&](auto& t) { t.bind_target(c.face, w); });
    return w;
  }

  void code_new_faces(const SplitMesh::Fan& fan) {
    if (fan.closed) {
      std::uint32_t last = fan.end - 1;
      for (std::uint32_t i = fan.begin; i < fan.end; last = i++) code_edge(last, i);
    } else {
      code_edge(kNone, fan.begin);
      for (std::uint32_t i = fan.begin + 1; i < fan.end; ++i) code_edge(i - 1, i);
      code_edge(fan.end - 1, kNone);
    }
  }
  /// New faces at the edge between two corners of a fan, or at an end of an open one.
  void code_edge(std::uint32_t last, std::uint32_t next) {
    const bool inside = last != kNone && next != kNone;
    const Corner& c = corners_[next != kNone ? next : last];
    const std::uint32_t x = next != kNone ? c.a : c.b;
    const std::size_t kind = inside    ? (corners_[last].moves != corners_[next].moves ? 1 : 0)
                             : c.moves ? 3
                                       : 2;
    for (std::size_t n = 0; channel_.bit(models_.more_faces[kind][std::min<std::size_t>(n, 1)],
                                         [&](auto& t) { return t.take(x); });
         ++n) {
      spend(1);
      code_face(x, last, next);
    }
  }
  /// One new face of parent, child and x.
  void code_face(std::uint32_t x, std::uint32_t last, std::uint32_t next) {
    const bool usual = next != kNone ? corners_[next].moves : !corners_[last].moves;
    const bool flipped = channel_.bit(models_.flipped, [&](auto& t) { return t.is_forward(x) != usual; });
    std::uint32_t moving = kNone, staying = kNone;  // corners beside the new face
    for (std::uint32_t i : {next, last})
      if (i != kNone) (corners_[i].moves ? moving : staying) = i;
    auto third = [&](std::uint32_t i) {
      return i == kNone ? kNone : mesh_.wedge_at(corners_[i].face, corners_[i].corner + (i == next ? 1 : 2));
    };
    const std::uint32_t mx = third(moving), sx = third(staying);
    std::size_t seam = 0;
    bool beside_moving = moving != kNone;
    if (moving != kNone && staying != kNone) {
      const bool wedge = corners_[moving].wedge != corners_[staying].wedge, far = mx != sx;
      if (wedge || far) {
        seam = 1;
        const std::uint32_t mw = corners_[moving].wedge, sw = corners_[staying].wedge;
        beside_moving = channel_.bit(models_.beside_moving[wedge && far ? 2
                                                           : far        ? 1
                                                                        : 0],
                                     [&](auto& t) { return t.fits_better(mw, mx, sw, sx); });
      }
    }
    const std::uint32_t beside = beside_moving ? moving : staying;
    std::uint32_t child = kNone;
    if (beside_moving)
      child = corners_[moving].target;
    else if (mapped_[corners_[staying].wedge] == split_number())
      child = map_target_[corners_[staying].wedge];
    finish_face(x, usual != flipped, {corners_[beside].wedge, child, beside_moving ? mx : sx}, seam,
                corners_[beside].face);
  }
  void code_extra_face() {
    const std::uint32_t x = number(mesh_.points().size(), [](auto& t) { return t.third_point(); });
    if (x == parent_ || x == child_) fail("three points of a face", "two");
    const bool forward = channel_.raw(1, [&](auto& t) { return t.is_forward(x) ? 1u : 0u; }) != 0;
    finish_face(x, forward, {kNone, kNone, kNone}, 1, kNone);
  }
  void finish_face(std::uint32_t x, bool forward, std::array<std::uint32_t, 3> expected, std::size_t seam,
                   std::uint32_t beside) {
    const std::uint32_t v = code_wedge(0, expected[0], models_.corner_expected[0][seam], parent_);
    const std::uint32_t u = code_wedge(1, expected[1], models_.corner_expected[1][seam], child_);
    const std::uint32_t w = code_wedge(2, expected[2], models_.corner_expected[2][seam], x);
    const std::uint16_t group = code_group(beside);
    add_face(forward ? std::array{v, w, u} : std::array{v, u, w}, group);
  }

  // ---- patches

  void seed_face() {
    fresh_.clear();
    channel_.know([](auto& t) { t.take_seed(); });
    std::array<std::uint32_t, 3> wedges{}, points{};
    for (std::uint32_t k = 0; k < 3; ++k) {
      const bool exists = !mesh_.points().empty() && channel_.bit(models_.seed_exists, [k](auto& t) {
        return t.wanted_point(k) != kNone;
      });
      if (exists) {
        points[k] = number(mesh_.points().size(), [k](auto& t) { return t.wanted_point(k); });
        if (k > 0 && (points[k] == points[0] || points[k] == points[k - 1]))
          fail("three points of a face", "two");
        wedges[k] = code_wedge(k, kNone, models_.listed, points[k]);
      } else {
        const std::uint32_t before =
            k > 0 ? points[0] : static_cast<std::uint32_t>(mesh_.points().size()) - 1;
        points[k] = new_patch_point(k, before == kNone ? SplitMesh::Point{} : mesh_.points()[before]);
        wedges[k] = new_patch_wedge(k, points[k]);
      }
    }
    finish_patch_face(wedges, kNone);
  }

  std::uint32_t new_patch_point(std::uint32_t role, SplitMesh::Point prediction) {
    const std::uint32_t p = add_point();
    channel_.know([&](auto& t) { t.bind_wanted_point(role, p); });
    channel_.point(mesh_.point(p), prediction, [p](auto& t) { return t.place(p); });
    return p;
  }
  std::uint32_t new_patch_wedge(std::uint32_t role, std::uint32_t p) {
    const std::uint32_t w = add_wedge(p, true);
    channel_.know([&](auto& t) { t.bind_wanted(role, w); });
    return w;
  }
  void finish_patch_face(std::array<std::uint32_t, 3> wedges, std::uint32_t beside) {
    const std::uint32_t face = add_face(wedges, code_group(beside));
    code_fresh_values();
    for (std::uint32_t k = 0; k < 3; ++k) gates_.push_back({face, k});
  }

  /// Corners of the fan around `point` that holds a corner of `face`.
  SplitMesh::Fan fan_of(std::uint32_t point, std::uint32_t face) {
    spend(mesh_.degree(point));
    mesh_.gather(point, corners_, fans_);
    for (const SplitMesh::Fan& fan : fans_)
      for (std::uint32_t i = fan.begin; i < fan.end; ++i)
        if (corners_[i].face == face) return fan;
    return {};
  }

  /// The face behind an open edge, if there is one; false when not.
  bool pass_gate(const Gate& gate) {
    const std::uint32_t face = gate.face, wa = mesh_.wedge_at(face, gate.corner),
                        wb = mesh_.wedge_at(face, gate.corner + 1);
    const std::uint32_t a = mesh_.point_at(face, gate.corner), b = mesh_.point_at(face, gate.corner + 1),
                        d = mesh_.point_at(face, gate.corner + 2);
    const SplitMesh::Fan at_a = fan_of(a, face);
    if (at_a.closed || corners_[at_a.begin].face != face) return false;  // the edge has two faces already
    const auto size_a = std::min<std::size_t>(at_a.end - at_a.begin, 8) - 1;
    const Corner left = corners_[at_a.end - 1];
    const SplitMesh::Fan at_b = fan_of(b, face);
    const auto size_b = std::min<std::size_t>(at_b.end - at_b.begin, 8) - 1;
    const Corner right = corners_[at_b.begin];
    if (!channel_.bit(models_.gate_open[size_a][size_b], [&](auto& t) { return t.take_gate(a, b); }))
      return false;
    fresh_.clear();
    const std::uint32_t new_b = code_wedge(1, wb, models_.patch_expected[0], b);
    const std::uint32_t new_a = code_wedge(0, wa, models_.patch_expected[1], a);
    const std::uint32_t c = code_third(a, b, d, left, right, size_a, size_b);
    finish_patch_face({new_b, new_a, c}, face);
    return true;
  }
  std::uint32_t code_third(std::uint32_t a, std::uint32_t b, std::uint32_t d, const Corner& left,
                           const Corner& right, std::size_t size_a, std::size_t size_b) {
    if (channel_.bit(models_.third_new[size_a][size_b], [](auto& t) { return t.wanted_point(2) == kNone; })) {
      SplitMesh::Point guess;
      for (std::size_t k = 0; k < 3; ++k)
        guess[k] = mesh_.points()[a][k] + mesh_.points()[b][k] - mesh_.points()[d][k];
      const std::uint32_t p = new_patch_point(2, guess);
      return new_patch_wedge(2, p);
    }
    auto is = [](std::uint32_t p) { return [p](auto& t) { return t.wanted_point(2) == p; }; };
    if (left.b != b && channel_.bit(models_.third_left[size_a][size_b], is(left.b)))
      return code_wedge(2, mesh_.wedge_at(left.face, left.corner + 2), models_.patch_expected[2], left.b);
    if (right.a != a && right.a != left.b && channel_.bit(models_.third_right, is(right.a)))
      return code_wedge(2, mesh_.wedge_at(right.face, right.corner + 1), models_.patch_expected[3], right.a);
    const std::uint32_t p = number(mesh_.points().size(), [](auto& t) { return t.wanted_point(2); });
    if (p == a || p == b) fail("three points of a face", "two");
    return code_wedge(2, kNone, models_.listed, p);
  }

  // ---- values

  static std::int32_t rounded_mean(std::int64_t sum, std::int64_t count) {
    return static_cast<std::int32_t>((2 * sum + count) / (2 * count));
  }

  void predict_point(std::uint32_t u) {
    std::array<std::int64_t, 3> sum{};
    std::int64_t count = 0;
    mesh_.each_corner(u, [&](std::uint32_t face, std::uint32_t corner) {
      const SplitMesh::Point &a = mesh_.points()[mesh_.point_at(face, corner + 1)],
                             &b = mesh_.points()[mesh_.point_at(face, corner + 2)];
      for (std::size_t k = 0; k < 3; ++k) sum[k] += a[k] + b[k];
      count += 2;
    });
    SplitMesh::Point guess = mesh_.points()[parent_];
    if (count > 0)
      for (std::size_t k = 0; k < 3; ++k) guess[k] = rounded_mean(sum[k], count);
    channel_.point(mesh_.point(u), guess, [u](auto& t) { return t.place(u); });
  }

  void code_fresh_values() {
    for (std::uint32_t w : fresh_) {
      const std::uint32_t p = mesh_.wedge_point()[w];
      std::uint32_t sibling = kNone;
      beside_.clear();
      spend(mesh_.degree(p));
      mesh_.each_corner(p, [&](std::uint32_t face, std::uint32_t corner) {
        const std::uint32_t own = mesh_.wedge_at(face, corner);
        if (own != w) {
          if (sibling == kNone && !pending_[own]) sibling = own;
          return;
        }
        for (std::uint32_t k = 1; k <= 2; ++k)
          if (const std::uint32_t other = mesh_.wedge_at(face, corner + k); !pending_[other])
            beside_.push_back(other);
      });
      for (std::size_t k = 0; k < mesh_.attributes(); ++k) {
        if (sibling != kNone &&
            channel_.same(k, [k, w, sibling](auto& t) { return t.equal(k, w, sibling); })) {
          std::copy_n(mesh_.value(k, sibling), mesh_.components(k), mesh_.value(k, w));
          continue;
        }
        const std::array<std::int32_t, 4> guess = predict_value(k, sibling);
        channel_.value(k, mesh_.value(k, w), guess, [k, w](auto& t) { return t.value(k, w); });
      }
      pending_[w] = false;
    }
    fresh_.clear();
  }
  /// The mean of the wedges beside it in its chart.
  std::array<std::int32_t, 4> predict_value(std::size_t k, std::uint32_t sibling) {
    if (beside_.empty()) {
      if (sibling != kNone)
        beside_.push_back(sibling);
      else if (parent_ != kNone && !corners_.empty())
        beside_.push_back(corners_[0].wedge);
    }
    std::array<std::int32_t, 4> guess{};
    if (beside_.empty()) return guess;
    return channel_.mean(k, mesh_, beside_);
  }

  SplitMesh& mesh_;
  Channel& channel_;
  std::size_t groups_;
  SplitLimits limits_;
  SplitModels models_;
  std::uint64_t work_ = 0;
  // Points to be asked, first come, first served; a point stands in the queue once.
  std::vector<std::uint32_t> queue_;
  std::size_t at_ = 0;
  bool last_answer_ = false, fruitless_ = false;
  std::vector<std::uint8_t> asks_;  // refusals 0..3, + 4 after a split in this chapter
  std::vector<bool> queued_;
  // The split or face under way:
  std::uint32_t parent_ = kNone, child_ = kNone;
  std::vector<Corner> corners_;
  std::vector<SplitMesh::Fan> fans_;
  std::vector<std::uint32_t> child_wedges_, fresh_, beside_;
  std::vector<Gate> gates_;
  // Per wedge, with the number of the walk or split for which they hold:
  std::vector<bool> pending_;  // has no values yet
  std::vector<std::uint32_t> listed_, mapped_, map_target_, stays_;
  std::uint32_t now_ = 0, stays_now_ = 0;
};

}  // namespace texmesh
