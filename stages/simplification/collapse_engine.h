#pragma once
#include "stages/simplification/collapse_cost.h"
#include "stages/simplification/collapse_queue.h"

namespace texmesh {

/// Why run_to came back.
enum class CollapseStop : std::uint8_t { kReached, kFewTriangles, kTooFar, kLocked };

/// Carries the half-edge collapses out, cheapest first, on a CollapseMesh.
///
/// A point's key is the cost of its cheapest legal collapse when that was last looked for. A collapse changes
/// the rings around it, but what it adds to them is one new neighbour each; the keys of those points are
/// lowered to the bound that its shape alone gives, and only marked. Whether a marked key holds is looked at
/// when it comes out first. So a collapse costs about two searches through a ring instead of eight.
class CollapseEngine {
 public:
  CollapseEngine(const ConditionedMesh& input, const ScaleMap& scale_map,
                 const SimplificationOptions& options, const RunContext& context);

  /// Collapses until at most `positions` are left, or something else stops it. `scale` bounds the thesis
  /// order: it only removes points whose persistence is under it.
  CollapseStop run_to(std::uint32_t positions, int scale, const RunContext& context);

  CollapseMesh& mesh() { return mesh_; }
  const CollapseMesh& mesh() const { return mesh_; }
  const std::vector<Collapse>& collapses() const { return collapses_; }

 private:
  static constexpr std::uint32_t kNone = kNoIndex;
  using Neighbour = CollapseRing::Neighbour;
  using WedgeMap = CollapseRing::WedgeMap;
  /// What a look at a point's ring found.
  struct Choice {
    std::uint32_t slot = kNone;  // of the cheapest legal collapse, kNone = there is none
    double key = 0;
    bool exact = true;     // no cheaper one was refused: the key bounds what changes around may free
    bool too_far = false;  // some exceed max_error
    bool found() const { return slot != kNone; }
  };
  enum Flag : std::uint8_t { kStale = 1, kExact = 2, kTooFar = 4 };

  void fill_queue(const RunContext& context);
  void prefetch_next() const;
  double shape_cost(std::uint32_t u, std::uint32_t v) const;
  double error_of(std::uint32_t u, std::uint32_t v) const;
  Choice evaluate(CollapseRing& ring, std::uint32_t u, WedgeMap& map) const;
  Choice choose(CollapseRing& ring, WedgeMap& map) const;
  Choice confirm(std::uint32_t u, WedgeMap& map);
  void enqueue(std::uint32_t u, std::uint32_t target_point, const Choice& choice);
  void reevaluate(std::uint32_t u);
  void apply_collapse(const WedgeMap& map);
  void update_around(std::uint32_t v);
  void remove_component(std::uint32_t component);
  bool retry_locked();

  const SimplificationOptions& options_;
  CollapseMesh mesh_;
  CollapseCost cost_;
  CollapseComponents components_;
  CollapseRing ring_;
  std::uint32_t initial_positions_ = 0;
  double fade_ = 1;                        // of the attributes' weight
  std::vector<std::uint8_t> persistence_;  // per point: highest of its positions
  std::vector<std::uint8_t> flags_;        // per point
  std::vector<std::uint32_t> target_;      // per point in the queue: where its key takes it
  CollapseQueue queue_;
  std::vector<Collapse> collapses_;
  std::size_t given_up_at_ = static_cast<std::size_t>(-1);  // collapses when all had been tried in vain
  // Memory that is used again and holds nothing between two calls, but for around_: the points around the
  // collapse in hand.
  WedgeMap scratch_map_;
  std::vector<std::uint32_t> around_, wedge_target_;
};

}  // namespace texmesh
