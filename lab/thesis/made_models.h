#pragma once

#include "stages/base/run_context.h"
#include "stages/data/conditioned_mesh.h"
#include "stages/data/fragments.h"
#include "stages/data/nested_scales.h"
#include "stages/data/pixels.h"
#include "stages/data/scale_map.h"
#include "stages/lut/lut.h"
#include "stages/zim/zim.h"

namespace texmesh {

/// Texture patterns made by code, from plain to complex, named (a) to (x) as the thesis's 24 of Fig. 8.2.
/// Pairs that the thesis compares are pairs here: (i) is (j) darkened, (n) is (p) darkened, (s) has the
/// sharpest edges on the brightest ground.
inline constexpr std::size_t kMadePatterns = 24;
inline constexpr std::uint32_t kPatternPx = 64;
std::string pattern_name(std::size_t pattern);
/// Index of the pattern with this letter.
inline std::size_t pattern_of(char letter) { return static_cast<std::size_t>(letter - 'a'); }

/// One plane, a fragment for each of these patterns, all covered, without feature points.
struct PatternPlane {
  Fragments fragments;
  std::vector<Pixels> pixels;
};
PatternPlane pattern_plane(const std::vector<std::size_t>& patterns, std::uint32_t columns);
/// Z, I and M alone: such planes lie on no mesh.
inline const ZimOptions kTexturePredictors{.weight_eta = 0};
/// The tables of such a plane that is encoded at these qualities.
LutTables plane_tables(const PatternPlane& plane, const std::vector<int>& rungs, const RunContext& context);

// Stand-ins for the thesis's models, whose data are not available: cylindrical range scans made by code.

enum class MadeShape { kHead, kNutcracker };
/// r(alpha, height) in mm: alpha in radians, 0 = the front; height 0..1 from below.
double made_radius(MadeShape shape, double alpha, double height);
/// The scan of a shape, `texture_px` wide and as high, or without texture for 0, as the importer of range
/// scans makes it. A full turn: columns x rows vertices and 2 columns (rows - 1) faces.
Model make_scan_model(MadeShape shape, std::uint32_t columns, std::uint32_t rows, std::uint32_t texture_px,
                      const RunContext& context);
/// One row of samples around the shape; without a height, at that of a head's nose or a nutcracker's belt.
RangeGrid made_ring(MadeShape shape, std::uint32_t samples, double height = 0.46);

/// The thesis's chain of scales: filtered by r(alpha, y), removed by the scale map, merged into the closest
/// neighbour.
struct MadeChain {
  ConditionedMesh mesh;
  ScaleMap map;
  NestedScales scales;
};
MadeChain thesis_chain(const Model& model, const RunContext& context);

/// A picture of stone and paint with detail of all sizes, 0..255 in three channels. `contrast` > 0; 1 just
/// fills that range.
Pixels made_texture(std::uint32_t side_px, double contrast, std::uint32_t seed, const RunContext& context);
/// A deterministic number in 0..1.
double lattice_noise(double x, double y, std::uint32_t seed);

}  // namespace texmesh
