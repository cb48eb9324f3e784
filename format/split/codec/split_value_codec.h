#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "format/split/codec/split_site.h"

namespace texmesh {

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

}  // namespace texmesh
