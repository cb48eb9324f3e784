#pragma once
#include <algorithm>
#include <cstdint>

#include "format/split/codec/split_element_codec.h"
#include "format/split/codec/split_patch_codec.h"
#include "format/split/codec/split_queue.h"
#include "format/split/codec/split_vertex_codec.h"

namespace texmesh {

/// The order of decisions that writer and reader share. Channel::bit(model, truth) codes a decision:
/// the writer's channel asks truth(its knowledge) and writes the answer, the reader's reads it and
/// never calls truth.
template <class Channel>
class SplitCodec {
 public:
  SplitCodec(SplitMesh& mesh, Channel& channel, std::size_t groups, SplitLimits limits)
      : elements_(mesh, channel, groups, limits), queue_(mesh), vertices_(elements_), patches_(elements_) {}
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
};

}  // namespace texmesh
