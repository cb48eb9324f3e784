#include "stages/quality/bands.h"

#include <algorithm>

#include "stages/measure/picture.h"
#include "stages/render/visibility.h"

namespace texmesh::quality {
namespace {

/// Of what views show of the object, on average: more say hardly more.
constexpr double kEnoughPixels = 30000;
/// In units of kBandPx: of 96 rows 76 are compared.
constexpr std::uint32_t kBandTiles = 3, kLeastBands = 2;

std::uint32_t tiles_of(std::uint32_t side_px) { return (side_px + kBandPx - 1) / kBandPx; }

struct TileRange {
  std::uint32_t first = 0, end = 0;
};
TileRange shown_tiles(const ShownRows& view, std::uint32_t side_px) {
  const double side = side_px;
  const auto tile = [&](double row) { return static_cast<std::uint32_t>(row) / kBandPx; };
  return {tile(view.first * side), std::min(tile(view.end * side) + 1, tiles_of(side_px))};
}

/// The share of what a view shows that is compared.
double share_compared(const ShownRows& view, const std::vector<std::uint8_t>& compared) {
  const std::size_t rows = view.pixels.size();
  double sum = 0, all = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    all += view.pixels[i];
    if (compared[(2 * i + 1) * compared.size() / (2 * rows)]) sum += view.pixels[i];
  }
  return all > 0 ? sum / all : 0;
}

}  // namespace

void Bands::cut(Picture& picture) const {
  for (std::size_t y = 0; y < compared.size(); ++y)
    if (!compared[y]) std::fill_n(picture.covered.data() + y * picture.side_px, picture.side_px, 0);
}

Bands choose_bands(const ShownRows& view, std::uint32_t side_px, double pixels) {
  const TileRange shown = shown_tiles(view, side_px);
  const auto enough = static_cast<std::uint32_t>(std::clamp(pixels / kEnoughPixels, 1.0, 1e6));
  const std::uint32_t period = std::min(enough, (shown.end - shown.first) / (kBandTiles * kLeastBands));
  if (period <= 1) return {};
  const std::uint32_t tiles = tiles_of(side_px), cycle = period * kBandTiles;
  // A band lies in the middle of what is shown.
  const std::uint32_t begin = (shown.first + shown.end - kBandTiles) / 2 % cycle;
  Bands out;
  for (std::uint32_t t = 0; t < tiles; ++t) out.rendered.push_back((t + cycle - begin) % cycle < kBandTiles);
  constexpr std::uint32_t kReach = measure::kFilterReach;
  for (std::uint32_t y = 0; y < side_px; ++y) {
    const std::uint32_t first = y - std::min(y, kReach), last = std::min(y + kReach, side_px - 1);
    out.compared.push_back(out.rendered[first / kBandPx] && out.rendered[last / kBandPx]);
  }
  if (share_compared(view, out.compared) < 0.4 / period) return {};  // of 76 rows in 96
  return out;
}

}  // namespace texmesh::quality
