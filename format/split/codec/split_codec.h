#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#include "format/split/codec/split_element_codec.h"
#include "format/split/codec/split_patch_codec.h"
#include "format/split/codec/split_queue.h"
#include "format/split/codec/split_vertex_codec.h"
#include "format/split/split_ahead.h"

namespace texmesh {

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
