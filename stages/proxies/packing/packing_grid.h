#pragma once
// Inside proxies only: which cells of a texture are taken.
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "stages/proxies/packing/chart_mask.h"

namespace texmesh {

/// A bitmap that charts are put on. 64 places are tried at once: the places of a row that a run of cells
/// forbids are the row's taken cells, moved by each of the run's offsets and joined.
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
  void forbid_run(const std::uint64_t* taken, const ChartMask::Run& run);
  std::uint32_t widest_gap(std::uint32_t y);
  std::uint64_t* row(std::uint32_t y) { return &taken_[std::size_t{y} * words_]; }

  std::uint32_t width_, height_, gutter_, words_;
  std::vector<std::uint64_t> taken_;               // rows of words; bit x % 64 of word x / 64
  std::vector<std::uint32_t> gaps_;                // per row: free cells side by side, at most
  std::vector<std::uint64_t> forbidden_, joined_;  // one row each
};

}  // namespace texmesh
