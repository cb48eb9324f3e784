#pragma once
// Inside the room only: which cells of a texture a chart touches, and which are taken.
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// Cells that are touched, as runs of each row.
struct ChartMask {
  struct Run {
    std::uint32_t row = 0, first = 0, count = 0;
  };
  std::uint32_t width = 0, height = 0;  // cells
  std::vector<Run> runs;                // by row, then by first; runs of a row do not touch
  std::uint64_t cell_count() const;
};

/// The cells, unit squares, whose inside the triangles touch. Corners lie in [0, width] x [0, height].
ChartMask mask_of(std::span<const std::array<Vec2d, 3>> triangles, std::uint32_t width, std::uint32_t height);

/// The mask turned by a quarter: (x, y) -> (height - y, x).
ChartMask quarter_turned(const ChartMask& mask);

/// A bitmap that charts are put on. 64 places are tried at once: the places of a row that a run of cells
/// forbids are the row's taken cells, moved by each of the run's offsets and joined. Rows are kept joined
/// over 1, 2, 4, ... offsets, so two of these make those of any run.
class PackingGrid {
 public:
  PackingGrid(std::uint32_t width, std::uint32_t height, std::uint32_t gutter);

  struct Place {
    std::uint32_t x = 0, y = 0;
  };
  /// The topmost place where the mask meets nothing that is taken, of these the leftmost; its row is at most
  /// `last_row`.
  std::optional<Place> first_free(const ChartMask& mask, std::uint32_t last_row);
  /// Takes the mask's cells and those within the gutter, diagonals included.
  void take(const ChartMask& mask, Place place);

 private:
  bool may_hold(std::span<const ChartMask::Run> runs, std::uint32_t y) const;
  bool forbid(std::span<const ChartMask::Run> runs, std::uint32_t width, std::uint32_t y);
  void forbid_run(std::uint32_t y, const ChartMask::Run& run);
  const std::uint64_t* joined(std::uint32_t y, std::uint32_t power);
  std::uint32_t widest_gap(std::uint32_t y);
  std::uint64_t* row(std::uint32_t y, std::uint32_t power = 0) {
    return &taken_[(std::size_t{y} * powers_ + power) * (words_ + 1)];
  }

  std::uint32_t width_, height_, gutter_, words_, powers_;
  // Per row: its words, bit x % 64 of word x / 64, and one word of 0; then the same for x or x + 1, for x to
  // x + 3, and so on.
  std::vector<std::uint64_t> taken_;
  std::vector<std::uint8_t> made_;        // per row: how many of these are up to date
  std::vector<std::uint32_t> gaps_;       // per row: free cells side by side, at most
  std::vector<std::uint64_t> forbidden_;  // one row
};

}  // namespace texmesh
