#pragma once
#include <algorithm>
#include <array>
#include <cstdint>

#include "format/split/codec/split_element_codec.h"
#include "format/split/codec/split_move_codec.h"

namespace texmesh {

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

}  // namespace texmesh
