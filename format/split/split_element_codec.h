#pragma once

#include "format/base/errors.h"
#include "format/split/split_coder.h"
#include "format/split/split_mesh.h"
#include "format/split/split_stream.h"

namespace texmesh {

inline constexpr const char* kSplitStreamName = "mesh/stream.bin";

[[noreturn]] inline void fail_split_stream(const char* rule, const std::string& place,
                                           const std::string& expected, const std::string& found) {
  throw RuleError(rule, kSplitStreamName, place, expected, found);
}
[[noreturn]] inline void fail_split_stream(const char* rule, const std::string& expected,
                                           const std::string& found) {
  fail_split_stream(rule, "", expected, found);
}

/// Bounds the codec's steps by the size of the mesh. Otherwise a few bytes could ask many points, or go round
/// a point of huge degree many times.
class SplitStepLimit {
 public:
  explicit SplitStepLimit(const SplitMesh& mesh) : mesh_(mesh) {}
  /// FormatError when the stream needed too many steps.
  void add(std::uint64_t steps) {
    steps_ += steps;
    if (steps_ > (std::uint64_t{1} << 20) + 256 * (mesh_.points().size() + mesh_.face_count()))
      fail_split_stream("S20", "splits that are found in reasonable time",
                        "more steps than 256 per point and face");
  }

 private:
  const SplitMesh& mesh_;
  std::uint64_t steps_ = 0;
};

/// The split or the patch's edge that the codec works at.
struct SplitSite {
  std::uint32_t parent = kNoIndex, child = kNoIndex;  // none in a patch
  std::vector<SplitMesh::Corner> corners;             // of the point looked at, sorted into fans
  std::vector<SplitMesh::Fan> fans;
  std::vector<std::uint32_t> child_wedges;  // in the order in which they were made
};

/// Codes places of points and attributes of wedges: predictions from the mesh so far and residuals.
template <class Channel>
class SplitValueCodec {
 public:
  SplitValueCodec(SplitMesh& mesh, Channel& channel, const SplitSite& site, SplitStepLimit& steps)
      : mesh_(mesh), channel_(channel), site_(site), steps_(steps) {}

  /// A new wedge of the mesh; its values are coded later unless they were copied.
  void add_wedge(std::uint32_t wedge, bool is_pending) {
    is_pending_.push_back(is_pending);
    if (is_pending) fresh_.push_back(wedge);
  }
  void clear_fresh() { fresh_.clear(); }

  void code_point(std::uint32_t p, const SplitMesh::Point& guess) {
    channel_.point(mesh_.point(p), guess, [p](auto& t) { return t.place(p); });
  }
  /// The child of a split: predicted by the mean of its neighbours.
  void code_child_point() {
    std::array<std::int64_t, 3> sum{};
    std::int64_t count = 0;
    mesh_.each_corner(site_.child, [&](std::uint32_t face, std::uint32_t corner) {
      const SplitMesh::Point &a = mesh_.points()[mesh_.point_at(face, corner + 1)],
                             &b = mesh_.points()[mesh_.point_at(face, corner + 2)];
      for (std::size_t k = 0; k < 3; ++k) sum[k] += a[k] + b[k];
      count += 2;
    });
    SplitMesh::Point guess = mesh_.points()[site_.parent];
    if (count > 0)
      for (std::size_t k = 0; k < 3; ++k) guess[k] = rounded_mean(sum[k], count);
    code_point(site_.child, guess);
  }
  /// Values of the wedges that have none yet.
  void code_fresh_wedges() {
    for (std::uint32_t w : fresh_) {
      const std::uint32_t sibling = gather_known_wedges(w);
      for (std::size_t k = 0; k < mesh_.attributes(); ++k) code_value(k, w, sibling);
      is_pending_[w] = false;
    }
    fresh_.clear();
  }

 private:
  static std::int32_t rounded_mean(std::int64_t sum, std::int64_t count) {
    return static_cast<std::int32_t>((2 * sum + count) / (2 * count));
  }
  /// Finds the wedges with values beside `wedge` in its chart. Returns another wedge with values of the same
  /// point, kNoIndex for none.
  std::uint32_t gather_known_wedges(std::uint32_t wedge) {
    const std::uint32_t point = mesh_.wedge_point()[wedge];
    std::uint32_t sibling = kNoIndex;
    beside_.clear();
    steps_.add(mesh_.degree(point));
    mesh_.each_corner(point, [&](std::uint32_t face, std::uint32_t corner) {
      const std::uint32_t at_corner = mesh_.wedge_at(face, corner);
      if (at_corner != wedge) {
        if (sibling == kNoIndex && !is_pending_[at_corner]) sibling = at_corner;
        return;
      }
      for (std::uint32_t k = 1; k <= 2; ++k)
        if (const std::uint32_t other = mesh_.wedge_at(face, corner + k); !is_pending_[other])
          beside_.push_back(other);
    });
    return sibling;
  }
  void code_value(std::size_t k, std::uint32_t wedge, std::uint32_t sibling) {
    if (sibling != kNoIndex &&
        channel_.same(k, [k, wedge, sibling](auto& t) { return t.equal(k, wedge, sibling); })) {
      std::copy_n(mesh_.value(k, sibling), mesh_.components(k), mesh_.value(k, wedge));
      return;
    }
    const std::array<std::int32_t, 4> guess = predict_value(k, sibling);
    channel_.value(k, mesh_.value(k, wedge), guess, [k, wedge](auto& t) { return t.value(k, wedge); });
  }
  /// The mean of the wedges beside it in its chart.
  std::array<std::int32_t, 4> predict_value(std::size_t k, std::uint32_t sibling) {
    if (beside_.empty()) {
      if (sibling != kNoIndex)
        beside_.push_back(sibling);
      else if (site_.parent != kNoIndex && !site_.corners.empty())
        beside_.push_back(site_.corners[0].wedge);
    }
    if (beside_.empty()) return {};
    return channel_.mean(k, mesh_, beside_);
  }

  SplitMesh& mesh_;
  Channel& channel_;
  const SplitSite& site_;
  SplitStepLimit& steps_;
  std::vector<bool> is_pending_;  // per wedge: has no values yet
  std::vector<std::uint32_t> fresh_, beside_;
};

/// Probabilities of the connectivity part; they go on learning through the whole stream.
struct SplitModels {
  static constexpr std::uint8_t kLimit = 200;
  static constexpr int kDegrees = 14, kAsks = 4, kLeft = 12, kRun = 7, kRing = 8, kValence = 5;
  using Pair = std::array<BitModel, 2>;
  using PerValence = std::array<BitModel, kValence>;
  // [degree][refusals][split before][last]
  std::array<std::array<std::array<Pair, 2>, kAsks>, kDegrees> ask;

  // A fan's corners change from staying to moving and back.
  std::array<Pair, kLeft> first;                                     // [corners][not the first fan]
  std::array<std::array<std::array<PerValence, kLeft>, 2>, 2> turn;  // [open][moving][left][valence]
  // [open][moving][run][ring][valence]
  std::array<std::array<std::array<std::array<PerValence, kRing>, kRun>, 2>, 2> turn_back;
  std::array<Pair, 2> turn_again;  // [open][moving]

  Pair target_expected;            // [has one]
  Pair target_copied;              // [the parent loses the wedge]
  BitModel listed;                 // this wedge of a list
  std::array<Pair, 4> more_faces;  // [kind of edge][has one]
  BitModel flipped, extra_face, same_group;
  std::array<BitModel, 3> beside_moving;  // [what differs]
  std::array<Pair, 3> corner_expected;    // [parent, child, third][seam]

  // Patches:
  BitModel seed_exists;
  std::array<std::array<BitModel, 8>, 8> gate_open, third_new, third_left;  // [fan at start][fan at end]
  BitModel third_right;
  std::array<BitModel, 4> patch_expected;  // [corner of the edge; third beside the start, beside the end]
};

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
  std::uint32_t code_index(std::size_t count, auto&& truth) {
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
