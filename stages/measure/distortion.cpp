#include "stages/measure/distortion.h"

#include <utility>

namespace texmesh {
namespace {

constexpr double kC1 = 0.01 * 255 * 0.01 * 255, kC2 = 0.03 * 255 * 0.03 * 255;

/// SSIM of a window from its sums, multiplied out by n^2 so that one division does.
double ssim(double n, double sx, double sxx, double sy, double syy, double sxy) {
  const double c1 = kC1 * n * n, c2 = kC2 * n * n;
  const double covariance = n * sxy - sx * sy, variances = n * (sxx + syy) - sx * sx - sy * sy;
  return (2 * sx * sy + c1) * (2 * covariance + c2) / ((sx * sx + sy * sy + c1) * (variances + c2));
}

}  // namespace

DistortionMeter::DistortionMeter(std::vector<std::uint8_t> source, std::vector<std::uint8_t> mask,
                                 std::uint32_t width, std::uint32_t height)
    : source_(std::move(source)),
      mask_(std::move(mask)),
      width_(width),
      columns_(width / 4),
      rows_(height / 4) {
  for (std::size_t k = 0; k < source_.size(); ++k) source_[k] &= mask_[k];
  cells_.resize(std::size_t{columns_} * rows_);
  for (std::size_t y = 0; y < height; ++y)
    for (std::size_t c = 0; c < columns_; ++c) {
      SourceCell cell = cells_[y / 4 * columns_ + c];
      for (std::size_t x = y * width_ + 4 * c; x < y * width_ + 4 * c + 4; ++x) {
        const std::uint32_t value = source_[x];
        cell.count += mask_[x] & 1;
        cell.sum += value;
        cell.square += value * value;
      }
      cells_[y / 4 * columns_ + c] = cell;
    }
}

/// A row of cells: first down the columns of texels, which runs in lanes, then four columns each. `sums` is
/// room for 3 x width.
void DistortionMeter::sum_cells(const std::vector<std::uint8_t>& decoded, std::uint32_t row,
                                std::vector<DecodedCell>& out, std::vector<std::uint32_t>& sums) const {
  const std::size_t width = width_;
  sums.assign(3 * width, 0);
  std::uint32_t *sum = sums.data(), *square = sum + width, *product = square + width;
  for (std::size_t y = 0; y < 4; ++y) {
    const std::size_t at = (std::size_t{row} * 4 + y) * width;
    const std::uint8_t *shown = decoded.data() + at, *mask = mask_.data() + at, *source = source_.data() + at;
    for (std::size_t x = 0; x < width; ++x) {
      const auto value = static_cast<std::uint16_t>(shown[x] & mask[x]);
      sum[x] += value;
      square[x] += static_cast<std::uint16_t>(value * value);
      product[x] += static_cast<std::uint16_t>(value * source[x]);
    }
  }
  const auto four = [](const std::uint32_t* of) { return of[0] + of[1] + of[2] + of[3]; };
  for (std::size_t c = 0; c < columns_; ++c)
    out[c] = {four(sum + 4 * c), four(square + 4 * c), four(product + 4 * c)};
}

Distortion DistortionMeter::against(const std::vector<std::uint8_t>& decoded) const {
  std::uint64_t count = 0, error = 0, weight = 0;
  double similarity = 0;
  std::vector<DecodedCell> above(columns_), here(columns_);
  std::vector<std::uint32_t> sums;
  for (std::uint32_t r = 0; r < rows_; ++r) {
    above.swap(here);
    sum_cells(decoded, r, here, sums);
    for (std::uint32_t c = 0; c < columns_; ++c) {
      const SourceCell& s = cells_[std::size_t{r} * columns_ + c];
      count += s.count;
      error += s.square + here[c].square - 2 * std::uint64_t{here[c].product};
    }
    for (std::uint32_t c = 1; r > 0 && c < columns_; ++c) {
      const SourceCell* s = cells_.data() + std::size_t{r} * columns_ + c;
      const std::uint32_t n = s[0].count + s[-1].count + (s - columns_)[0].count + (s - columns_)[-1].count;
      if (n == 0) continue;
      const auto source = [&](auto member) {
        return s[0].*member + s[-1].*member + (s - columns_)[0].*member + (s - columns_)[-1].*member;
      };
      const auto coded = [&](auto member) {
        return here[c].*member + here[c - 1].*member + above[c].*member + above[c - 1].*member;
      };
      weight += n;
      similarity +=
          n * ssim(n, source(&SourceCell::sum), source(&SourceCell::square), coded(&DecodedCell::sum),
                   coded(&DecodedCell::square), coded(&DecodedCell::product));
    }
  }
  return {static_cast<double>(error) / static_cast<double>(count),
          1 - similarity / static_cast<double>(weight)};
}

}  // namespace texmesh
