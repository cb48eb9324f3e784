#pragma once
// Inside stages only: how a texture is cut, and how a triangle spreads over the pieces.

#include "format/model/model.h"

namespace texmesh {

/// Columns x rows fragments of equal size; the last ones may reach beyond the image.
struct FragmentGrid {
  std::uint32_t width_px = 0, height_px = 0;  // of the image
  std::uint32_t fragment_width_px = 0, fragment_height_px = 0, columns = 0, rows = 0;
  std::string reason;
};

/// The grid with the least overhead for what is covered. `coverage` is as TexturePlane::coverage; empty
/// stands for all of the image. Candidates have at most max_fragments fragments, whose sides are multiples of
/// 16 up to 256 px and at least min_px where the image allows.
/// - The overhead of a grid is 64 bytes for every stored fragment and 0.01 bytes for every texel of a stored
///   fragment that is not covered. Small sides win where they skip more than they cost.
/// - Grids with fewer than 64 stored fragments are taken only when there are none with more: harmonic time
///   compensation with 16 fragments misses its deadline by 0.8 %, with 64 by 0.1 %.
/// - Sides grow beyond 256 px where max_fragments asks for it, but not above 65488 px (JPEG). A larger image
///   has more than max_fragments when that is 1.
/// The numbers were measured on scans cut into sides of 128 and 256 px. A fragment takes 7 bytes of a rung's
/// streams (4 are headers, the others for starting prediction and bytes anew), 15 bytes in the tables for
/// every rung and 61 to 68 once. An uncovered texel takes 0.006 bytes at quality 18, 0.009 at 53, 0.011 at
/// 86. A fragment thus costs a package of ten rungs 28 bytes a rung, and a load, which takes the tables whole
///   and one rung, some 220: 64 lies between. Three scans and their mips get the same grids from 30 to 64.
FragmentGrid choose_grid(std::uint32_t width_px, std::uint32_t height_px,
                         const std::vector<std::uint8_t>& coverage, std::uint32_t max_fragments,
                         std::uint32_t min_px);

/// Adds `amount` to the fragments in proportion to the area of the triangle in them (texel coordinates,
/// wrapped; a fragment may be met several times where a texture tiles). A triangle without area counts where
/// its longest edge lies; one that spreads over more than 4096 fragment cells counts evenly over the whole
/// image.
class AreaSpreader {
 public:
  explicit AreaSpreader(const FragmentGrid& grid) : grid_(grid) {}
  void add(const std::array<Vec2d, 3>& triangle, Wrap wrap_s, Wrap wrap_t, double amount,
           std::vector<double>& fragments);

 private:
  /// A stretch of the unwrapped axis that falls into one row or column of fragments.
  struct Cell {
    double begin, end;
    std::uint32_t index;
  };
  static bool cut(double lo, double hi, std::uint32_t size, std::uint32_t step, Wrap wrap,
                  std::vector<Cell>& out);
  void add_evenly(double amount, std::vector<double>& fragments) const;
  void add_longest_edge(const std::array<Vec2d, 3>& triangle, Wrap wrap_s, Wrap wrap_t, double amount,
                        std::vector<double>& fragments) const;
  void add_clipped(const std::array<Vec2d, 3>& triangle, double amount, std::vector<double>& fragments) const;

  const FragmentGrid& grid_;
  std::vector<Cell> columns_, rows_;  // of the triangle in hand
};

/// The fragment that holds a point in texel coordinates, after wrapping.
std::uint32_t fragment_at(const FragmentGrid& grid, Vec2d point, Wrap wrap_s, Wrap wrap_t);

}  // namespace texmesh
