#pragma once
#include <cstdint>
#include <vector>

#include "stages/simplification/collapse_mesh.h"
#include "stages/simplification/collapse_ring.h"
#include "stages/simplification/quadric.h"
#include "stages/simplification/simplification.h"

namespace texmesh {

/// What a collapse costs: squared distance to the planes of all the triangles that a point stands for, to
/// planes that stand upright on borders and seams (so that these lines stay where they are), and the
/// distortion of texture, normals and colours, as lengths. In the frame of unit diagonal, times area.
class CollapseCost {
 public:
  CollapseCost(const CollapseMesh& mesh, const Mesh& input, const SimplificationOptions& options);

  const Quadric& quadric(std::uint32_t point) const { return quadric_[point]; }
  bool has_attributes() const { return attribute_quadric_.channels() > 0; }
  /// As CollapseMesh::prefetch_list.
  void prefetch_point(std::uint32_t point) const {
    const auto* q = reinterpret_cast<const char*>(&quadric_[point]);
    __builtin_prefetch(q);
    __builtin_prefetch(q + sizeof(Quadric) - 1);
  }
  void prefetch_wedge(std::uint32_t wedge) const {
    if (!has_attributes()) return;
    __builtin_prefetch(attributes(wedge));
    attribute_quadric_.prefetch(wedge);
  }
  struct Distortion {
    double cost = 0;
    double shift = 0;  // of the texture, root mean square over the area that the centre's wedges stand for
  };
  /// Of the ring's centre moved into the map's neighbour.
  Distortion distortion(const CollapseRing& ring, const CollapseRing::WedgeMap& map) const;
  /// Hands what the ring's centre carries to the map's neighbour, and what the ring's wedges carry to their
  /// targets. A wedge without a target gets a new one behind all others, in the ring's order, as
  /// CollapseMesh::add_wedge gives them.
  void merge(const CollapseRing& ring, const CollapseRing::WedgeMap& map);

 private:
  void add_shape();
  void add_lines(const Mesh& input, const SimplificationOptions& options);
  void add_attributes(const Mesh& input, const SimplificationOptions& options);
  void fill_attributes(const Mesh& input, const SimplificationOptions& options);
  void add_gradients(const CollapseMesh::Face& face);
  AttributeQuadrics::Step step(std::uint32_t from, std::uint32_t to) const;
  const double* attributes(std::uint32_t wedge) const {
    return attribute_.data() + wedge * attribute_quadric_.channels();
  }

  const CollapseMesh& mesh_;
  std::vector<Quadric> quadric_;                       // per point
  std::size_t texture_channels_ = 0;                   // the first of the channels
  bool colour_varies_ = false, alpha_varies_ = false;  // have channels, behind those of the normals
  double shift_per_cost_ = 0;                          // takes the weight of the texture out again
  std::vector<double> attribute_;                      // per wedge: its attributes as lengths
  AttributeQuadrics attribute_quadric_;                // per wedge
};

}  // namespace texmesh
