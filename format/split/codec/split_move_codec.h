#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "format/split/codec/split_element_codec.h"

namespace texmesh {

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

}  // namespace texmesh
