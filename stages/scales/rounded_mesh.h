#pragma once
// Inside the room only.
#include <cstdint>
#include <vector>

#include "format/split/look_ahead.h"
#include "format/split/split_source.h"
#include "stages/data/nested_scales.h"
#include "stages/scales/vertex_split.h"

namespace texmesh {

/// Rounded values, wedge by wedge, and what is equal merged: the source's points, wedges, attributes.
class RoundedMesh {
 public:
  RoundedMesh(const NestedScales& scales, const VertexSplitCoding& coding);
  std::uint32_t point(std::uint32_t position) const { return point_.at(position); }
  /// Asks memory for what point() will read.
  void look_ahead(std::uint32_t position) const { ask_memory(&point_[position]); }
  std::uint32_t wedge(std::uint32_t mesh_wedge) const { return wedge_.at(mesh_wedge); }
  std::uint32_t point_of(std::uint32_t wedge) const { return wedge_point_[wedge]; }
  std::size_t points() const { return places_.size(); }

  /// A wedge with the values of another one at another point.
  std::uint32_t add_wedge(std::uint32_t wedge, std::uint32_t point);
  void move_to(SplitSource& source);

 private:
  void add_attributes();
  void append_value(const SplitAttribute& a, std::size_t w, std::vector<std::int32_t>& out) const;
  std::vector<std::uint32_t> by_points(std::vector<std::uint32_t>& end) const;
  void merge_wedges(const std::vector<std::vector<std::int32_t>>& all);

  const Mesh& mesh_;
  const VertexSplitCoding& coding_;
  std::vector<std::uint32_t> point_, wedge_;  // per position; per wedge of the mesh
  std::vector<SplitMesh::Point> places_;
  std::vector<std::uint32_t> wedge_point_;
  std::vector<SplitAttribute> attributes_;
  std::vector<std::vector<std::int32_t>> values_;
};

}  // namespace texmesh
