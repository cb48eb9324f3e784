#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "format/split/codec/split_element_codec.h"

namespace texmesh {

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

}  // namespace texmesh
