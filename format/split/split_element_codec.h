#pragma once
#include <bit>

#include "format/base/errors.h"
#include "format/split/split_mesh.h"
#include "format/split/split_stream.h"

namespace texmesh {

// The entropy coder of mesh/stream.bin (SPEC.md, section Split stream): binary decisions with adaptive
// probabilities in a carry-propagating range coder. Everything is 32-bit unsigned arithmetic without a
// product of more than 32 bits, so that a client in TypeScript computes the same with Math.imul and >>> 0.

/// Probability that a bit is 1. It learns by the reciprocal of what it has seen, down to 1 / (limit + 2).
struct BitModel {
  std::uint16_t p = 0x8000;  // of 65,536
  std::uint8_t seen = 0;

  std::uint32_t odds() const { return std::clamp<std::uint32_t>(p >> 4, 1, 4095); }  // of 4,096
  void learn(bool bit, std::uint8_t limit) {
    const std::uint32_t weight = 65535u / (seen + 2u);
    if (bit)
      p = static_cast<std::uint16_t>(p + (((65535u - p) * weight) >> 16));
    else
      p = static_cast<std::uint16_t>(p - ((p * weight) >> 16));
    if (seen < limit) ++seen;
  }
};

class BitEncoder {
 public:
  void encode(BitModel& model, bool bit, std::uint8_t limit) {
    put(model.odds(), bit);
    model.learn(bit, limit);
  }
  /// The lowest `count` bits of `value`, highest first, at one bit each.
  void encode_raw(std::uint32_t value, int count) {
    while (count-- > 0) put(2048, (value >> count) & 1);
  }
  /// Ends the code; the encoder can be used again. Zeros at the end are left out: the decoder
  /// reads them anyway.
  std::vector<std::uint8_t> finish() {
    // Of all numbers in [low, low + range) the one with the most zeros at its end.
    const std::uint64_t last = low_ + range_ - 1;
    std::uint64_t code = last;
    for (int zeros = 1; zeros <= 32; ++zeros) {
      const std::uint64_t candidate = last >> zeros << zeros;
      if (candidate < low_) break;
      code = candidate;
    }
    low_ = code;
    for (int i = 0; i < 5; ++i) shift();
    bytes_.erase(bytes_.begin());  // the coder's first byte is always 0
    while (!bytes_.empty() && bytes_.back() == 0) bytes_.pop_back();
    std::vector<std::uint8_t> out = std::move(bytes_);
    *this = BitEncoder{};
    return out;
  }

 private:
  void put(std::uint32_t odds, bool bit) {
    const std::uint32_t bound = (range_ >> 12) * odds;
    if (bit) {
      range_ = bound;
    } else {
      low_ += bound;
      range_ -= bound;
    }
    while (range_ < (1u << 24)) {
      range_ <<= 8;
      shift();
    }
  }
  void shift() {
    if (low_ < 0xff000000u || low_ > 0xffffffffu) {
      const auto carry = static_cast<std::uint8_t>(low_ >> 32);
      bytes_.push_back(static_cast<std::uint8_t>(held_ + carry));
      for (; pending_ > 0; --pending_) bytes_.push_back(static_cast<std::uint8_t>(0xff + carry));
      held_ = static_cast<std::uint8_t>(low_ >> 24);
    } else {
      ++pending_;
    }
    low_ = (low_ & 0x00ffffffu) << 8;
  }
  std::uint64_t low_ = 0;
  std::uint32_t range_ = 0xffffffffu, pending_ = 0;
  std::uint8_t held_ = 0;
  std::vector<std::uint8_t> bytes_;
};

/// Reads zeros behind the end.
class BitDecoder {
 public:
  explicit BitDecoder(std::span<const std::uint8_t> bytes = {}) : bytes_(bytes) {
    for (int i = 0; i < 4; ++i) code_ = code_ << 8 | next();
  }
  bool decode(BitModel& model, std::uint8_t limit) {
    const bool bit = decode_by_odds(model.odds());
    model.learn(bit, limit);
    return bit;
  }
  std::uint32_t decode_raw(int count) {
    std::uint32_t value = 0;
    while (count-- > 0) value = value << 1 | static_cast<std::uint32_t>(decode_by_odds(2048));
    return value;
  }

 private:
  std::uint32_t next() { return at_ < bytes_.size() ? bytes_[at_++] : 0; }
  bool decode_by_odds(std::uint32_t odds) {
    const std::uint32_t bound = (range_ >> 12) * odds;
    const bool bit = code_ < bound;
    if (bit) {
      range_ = bound;
    } else {
      code_ -= bound;
      range_ -= bound;
    }
    while (range_ < (1u << 24)) {
      range_ <<= 8;
      code_ = code_ << 8 | next();
    }
    return bit;
  }
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  std::uint32_t range_ = 0xffffffffu, code_ = 0;
};

/// Models of one part of values. Residuals are coded as the length of their magnitude in bits, in steps
/// relative to a running mean of lengths, then the two bits below the leading one, then the rest raw.
struct ValueModels {
  static constexpr int kSteps = 20, kBelow = 12;
  static constexpr std::uint8_t kValueLimit = 60,
                                kPrior = 24;  // a stream's models count as so many symbols seen
  static constexpr std::size_t kCount = 4 * kSteps + 3 * kBelow + 1;
  std::array<BitModel, kCount> all;
  BitModel& longer(int quarter, int step) { return all[static_cast<std::size_t>(quarter * kSteps + step)]; }
  BitModel& second(int length) { return all[static_cast<std::size_t>(4 * kSteps + below(length))]; }
  BitModel& third(int length, std::uint32_t higher) {
    return all[4 * kSteps + kBelow + 2 * static_cast<std::size_t>(below(length)) + higher];
  }
  BitModel& same() { return all[kCount - 1]; }
  static int below(int length) { return std::min(length, kBelow - 1); }
};

/// Bits of the magnitude of a residual: 0 for 0.
inline int residual_length(std::int32_t residual) {
  return std::bit_width(static_cast<std::uint32_t>(residual < 0 ? -residual : residual));
}

/// Codes residuals through `bits`, which is given the model (or a number of raw bits) and returns what was
/// coded; so the encoder and the decoder are the same code.
class ResidualCodec {
 public:
  static constexpr int kLongest = 26;
  ValueModels models;
  void start(int mean) { mean_.fill(mean); }  // in sixteenths of a bit

  std::int32_t residual(auto& bits, int component, std::int32_t value) {
    int& mean = mean_[static_cast<std::size_t>(component)];
    const int length = code_length(bits, mean, residual_length(value));
    mean += (length * 16 - mean) >> 3;
    if (length == 0) return 0;
    std::uint32_t magnitude = static_cast<std::uint32_t>(value < 0 ? -value : value), coded = 1;
    int left = length - 1;
    if (left > 0) coded = coded << 1 | bits.bit(models.second(length), (magnitude >> --left) & 1);
    if (left > 0) coded = coded << 1 | bits.bit(models.third(length, coded & 1), (magnitude >> --left) & 1);
    if (left > 0) coded = coded << left | bits.raw(magnitude & ((1u << left) - 1), left);
    const auto signed_value = static_cast<std::int32_t>(coded);
    return bits.raw(value < 0, 1) ? -signed_value : signed_value;
  }
  bool same(auto& bits, bool value) { return bits.bit(models.same(), value); }

 private:
  int code_length(auto& bits, int mean, int length) {
    const int middle = mean >> 4;
    auto is_longer = [&](int than) {
      const int step = std::clamp(than - middle + 10, 0, ValueModels::kSteps - 1);
      return bits.bit(models.longer((mean >> 2) & 3, step), length > than);
    };
    int at = std::clamp(middle - 2, 0, kLongest - 1);
    if (is_longer(at)) {
      do ++at;
      while (at < kLongest && is_longer(at));
    } else {
      while (at > 0 && !is_longer(at - 1)) --at;
    }
    return at;
  }
  std::array<int, 4> mean_{};  // per component
};

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
  static constexpr std::uint8_t kModelLimit = 200;
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
    if (mesh.wedge_point().size() >= limits_.wedges)
      fail_split_stream("S19", "wedges within the reader's limit", std::to_string(limits_.wedges));
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
