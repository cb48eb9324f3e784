#pragma once
#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <vector>

#include "format/split/codec/split_models.h"
#include "format/split/codec/split_site.h"
#include "format/split/codec/split_value_codec.h"
#include "format/split/split_stream.h"

namespace texmesh {

/// What vertex splits and patches have in common: new points, wedges and faces, and which wedge of a point
/// a corner gets.
template <class Channel>
class SplitElementCodec {
 public:
  SplitElementCodec(SplitMesh& mesh_so_far, Channel& coding_channel, std::size_t groups, SplitLimits limits)
      : mesh(mesh_so_far),
        channel(coding_channel),
        steps(mesh_so_far),
        values(mesh_so_far, coding_channel, site, steps),
        groups_(groups),
        limits_(limits) {}
  // The values refer to the site and the steps.
  SplitElementCodec(const SplitElementCodec&) = delete;
  SplitElementCodec& operator=(const SplitElementCodec&) = delete;

  std::uint32_t add_point() {
    if (mesh.points().size() >= limits_.points)
      fail_split_stream("S19", "points within the reader's limit", std::to_string(limits_.points));
    return mesh.add_point();
  }
  /// `is_pending`: the wedge's values are still to be coded.
  std::uint32_t add_wedge(std::uint32_t point, bool is_pending) {
    if (mesh.wedge_point().size() >= 3ull * limits_.faces)
      fail_split_stream("S19", "wedges within the reader's limit", std::to_string(limits_.faces));
    const std::uint32_t w = mesh.add_wedge(point);
    offered_.push_back(0);
    values.add_wedge(w, is_pending);
    return w;
  }
  std::uint32_t add_face(std::array<std::uint32_t, 3> wedges, std::uint16_t group) {
    if (mesh.face_count() >= limits_.faces)
      fail_split_stream("S19", "faces within the reader's limit", std::to_string(limits_.faces));
    const std::uint32_t face = mesh.add_face(wedges, group);
    channel.update_truth([&](auto& t) { t.bind_face(face); });
    return face;
  }
  /// `beside`: a face that probably has the same group, or kNoIndex.
  std::uint16_t code_group(std::uint32_t beside) {
    if (beside != kNoIndex) {
      const std::uint16_t group = mesh.face_group()[beside];
      if (channel.bit(models.same_group, [&](auto& t) { return t.wanted_group() == group; })) return group;
    }
    return static_cast<std::uint16_t>(code_index(groups_, [](auto& t) { return t.wanted_group(); }));
  }
  /// An index below `count`, every one as probable as the others.
  template <class Truth>
  std::uint32_t code_index(std::size_t count, Truth&& truth) {
    const std::uint32_t value = channel.raw(std::bit_width(count - 1), truth);
    if (value >= count) fail_split_stream("S19", "an index that exists", std::to_string(value));
    return value;
  }

  /// The wedge of corner `role` (0 parent or start, 1 child or end, 2 third) of the face under way at
  /// `point`: the expected one, one of the point's, or a new one.
  std::uint32_t code_wedge(std::uint32_t role, std::uint32_t expected, BitModel& model, std::uint32_t point) {
    const auto is = [&](std::uint32_t w) { return [w, role](auto& t) { return t.is_wanted(role, w); }; };
    if (expected != kNoIndex && channel.bit(model, is(expected))) return expected;
    ++round_;
    if (expected != kNoIndex) offered_[expected] = round_;
    std::uint32_t found = kNoIndex;
    const auto offer = [&](std::uint32_t w) {
      if (found != kNoIndex || offered_[w] == round_) return;
      offered_[w] = round_;
      if (channel.bit(models.listed, is(w))) found = w;
    };
    if (point == site.parent)
      for (const SplitMesh::Corner& c : site.corners) offer(c.wedge);
    if (point == site.child) {
      for (std::uint32_t w : site.child_wedges) offer(w);
    } else {
      steps.add(mesh.degree(point));
      mesh.each_corner(point,
                       [&](std::uint32_t face, std::uint32_t corner) { offer(mesh.wedge_at(face, corner)); });
    }
    if (found != kNoIndex) return found;
    const std::uint32_t w = add_wedge(point, true);
    if (point == site.child) site.child_wedges.push_back(w);
    channel.update_truth([&](auto& t) { t.bind_wanted(role, w); });
    return w;
  }

  SplitMesh& mesh;
  Channel& channel;
  SplitModels models;
  SplitSite site;
  SplitStepLimit steps;
  SplitValueCodec<Channel> values;

 private:
  std::size_t groups_;
  SplitLimits limits_;
  std::vector<std::uint32_t> offered_;  // per wedge: the last round in which it was offered
  std::uint32_t round_ = 0;
};

}  // namespace texmesh
