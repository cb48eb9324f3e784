#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "stages/collapse_mesh.h"
#include "stages/quadric.h"
#include "stages/run_context.h"
#include "stages/simplification.h"

namespace texmesh {

/// Why run_to came back.
enum class CollapseStop : std::uint8_t { kReached, kFewTriangles, kTooFar, kLocked };

/// Binary heap of points with changeable keys; equal keys come out by rising point index.
class CollapseQueue {
 public:
  explicit CollapseQueue(std::size_t points) : key_(points), at_(points, kOut) {}
  bool empty() const { return heap_.empty(); }
  std::uint32_t top() const { return heap_[0]; }
  double key(std::uint32_t p) const { return key_[p]; }
  bool contains(std::uint32_t p) const { return at_[p] != kOut; }
  void set(std::uint32_t p, double key);  // inserts or moves
  void erase(std::uint32_t p);

 private:
  static constexpr std::uint32_t kOut = 0xffffffffu;
  bool before(std::uint32_t a, std::uint32_t b) const {
    return key_[a] < key_[b] || (key_[a] == key_[b] && a < b);
  }
  void sift_up(std::size_t i);
  void sift_down(std::size_t i);
  std::vector<double> key_;
  std::vector<std::uint32_t> at_, heap_;
};

/// Carries the half-edge collapses out, cheapest first, on a CollapseMesh.
class CollapseEngine {
 public:
  CollapseEngine(const ConditionedMesh& input, const ScaleMap& scale_map,
                 const SimplificationOptions& options);

  /// Collapses until at most `positions` are left, or something else stops it. `scale` bounds the thesis
  /// order: it only removes points whose persistence is under it.
  CollapseStop run_to(std::uint32_t positions, int scale, const RunContext& context);

  const CollapseMesh& mesh() const { return mesh_; }
  const std::vector<Collapse>& collapses() const { return collapses_; }

 private:
  static constexpr std::uint32_t kNone = CollapseMesh::kNone;
  static constexpr int kMaxValence = 4;  // faces at an edge; an edge with more locks
  struct Pair {
    std::uint32_t from = 0, to = 0;
  };  // index into ring_wedges_ -> wedge of the neighbour
  struct Neighbour {
    std::uint32_t point = 0, valence = 0, pairs = 0, faces = 0, far_valence = 0;
    std::array<Pair, kMaxValence> pair;
    double cost = 0, error = 0;
  };
  struct Corner {
    std::uint32_t face = 0, corner = 0, a = 0, b = 0, wedge = 0;
  };  // a, b: neighbour slots
  struct Best {
    bool found = false, too_far = false;
    double key = 0;
    std::uint32_t slot = 0;
  };

  void add_shape_quadrics();
  void add_border_quadrics();
  void add_attribute_quadrics(const Mesh& mesh);
  std::vector<double> attribute_scales(const Mesh& mesh) const;

  void gather(std::uint32_t u);
  std::uint32_t slot_of(std::uint32_t point);
  bool allowed_by_borders(const Neighbour& n) const;
  bool map_wedges(std::uint32_t u, const Neighbour& n);
  bool positions_agree(std::uint32_t u, const Neighbour& n) const;
  void price(std::uint32_t u, Neighbour& n);
  bool keeps_topology(std::uint32_t u, std::uint32_t slot);
  bool keeps_orientation(std::uint32_t u, std::uint32_t slot) const;
  Best evaluate(std::uint32_t u);
  void apply(std::uint32_t u, const Neighbour& n);
  void refresh(std::uint32_t p);
  bool retry_locked();
  const double* attributes(std::uint32_t wedge) const { return attribute_.data() + wedge * channels_; }

  const Mesh& input_;
  const SimplificationOptions& options_;
  CollapseMesh mesh_;
  std::uint32_t initial_positions_ = 0;
  double fade_ = 1;               // of the attributes' weight
  std::vector<Quadric> quadric_;  // per point
  std::size_t channels_ = 0;
  std::vector<double> attribute_;          // per wedge: its attributes in units of length
  AttributeQuadrics attribute_quadric_;    // per wedge
  std::vector<std::uint8_t> persistence_;  // per point: highest of its positions
  std::vector<Collapse> collapses_;
  CollapseQueue queue_;
  bool some_too_far_ = false;
  std::size_t given_up_at_ = static_cast<std::size_t>(-1);  // collapses when all had been tried in vain

  // The ring around the point that is being looked at:
  std::vector<Corner> corners_;
  std::vector<Neighbour> neighbours_;
  std::vector<std::uint32_t> ring_wedges_,
      target_;  // wedges of the point; where the candidate maps each, kNone = keeps
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> stamp_, slot_;  // per point
  std::uint32_t now_ = 0;
  std::uint32_t odd_edges_ = 0, odd_valence_ = 0, usual_valence_ = 2;
  bool odd_mixed_ = false;
};

}  // namespace texmesh
