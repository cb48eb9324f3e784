#include "stages/measure/fragment_meter.h"

#include "stages/fragment_codec/fragment_codec.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh {
namespace {

constexpr double kC1 = 0.01 * 255 * 0.01 * 255, kC2 = 0.03 * 255 * 0.03 * 255;

/// SSIM of a window from its sums, multiplied out by n^2 so that one division does.
double ssim(double n, double sx, double sxx, double sy, double syy, double sxy) {
  const double c1 = kC1 * n * n, c2 = kC2 * n * n;
  const double covariance = n * sxy - sx * sy, variances = n * (sxx + syy) - sx * sx - sy * sy;
  return (2 * sx * sy + c1) * (2 * covariance + c2) / ((sx * sx + sy * sy + c1) * (variances + c2));
}

/// Channel `c` of `measured` of a row of texels.
template <std::size_t kChannels>
void measure_row(const std::uint8_t* texels, std::size_t count, std::size_t measured, std::size_t c,
                 std::uint8_t* to) {
  if (kChannels == 1 || measured > 1)
    for (std::size_t i = 0; i < count; ++i) to[i] = texels[kChannels * i + c];
  else
    for (std::size_t i = 0; i < count; ++i) to[i] = measured_value(texels + kChannels * i, kChannels, 1, 0);
}
void measure_row(const std::uint8_t* texels, std::size_t channels, std::size_t count, std::size_t measured,
                 std::size_t c, std::uint8_t* to) {
  const auto rows = channels == 1   ? measure_row<1>
                    : channels == 2 ? measure_row<2>
                    : channels == 3 ? measure_row<3>
                                    : measure_row<4>;
  rows(texels, count, measured, c, to);
}

bool varies(const std::vector<std::uint8_t>& values, const std::vector<std::uint8_t>& mask) {
  std::uint8_t low = 255, high = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!mask[i]) continue;
    low = std::min(low, values[i]);
    high = std::max(high, values[i]);
  }
  return low < high;
}

BilinearPlace place_of(std::uint32_t at, std::uint32_t size, std::uint32_t coarse_size) {
  // Centres of texels, in 1/256 of a coarse texel.
  const std::int64_t centre = (2 * std::int64_t{at} + 1) * coarse_size * 128 / size - 128;
  const auto clamped =
      static_cast<std::uint32_t>(std::clamp<std::int64_t>(centre, 0, (std::int64_t{coarse_size} - 1) * 256));
  return {clamped / 256, std::min(clamped / 256 + 1, coarse_size - 1), clamped % 256};
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

std::size_t measured_channels(const TexturePlane& plane) {
  return is_colour(plane.role) ? 1 : plane.channels;
}

Samples rectangle_samples(const TexturePlane& plane, const Pixels& pixels, const TexelRectangle& rectangle) {
  const std::size_t measured = measured_channels(plane);
  Samples out(measured);
  for (std::size_t c = 0; c < measured; ++c) {
    out[c].resize(std::size_t{rectangle.width_px} * rectangle.height_px);
    std::uint8_t* to = out[c].data();
    for (std::uint32_t y = rectangle.top_px; y < rectangle.bottom_px(); ++y, to += rectangle.width_px)
      measure_row(pixels.at(rectangle.left_px, y), pixels.channels, rectangle.width_px, measured, c, to);
  }
  return out;
}

std::vector<std::uint8_t> coverage_samples(const TexturePlane& plane, const TexelRectangle& rectangle) {
  const CoverageMask mask(plane);
  std::vector<std::uint8_t> out(std::size_t{rectangle.width_px} * rectangle.height_px);
  for (std::uint32_t v = 0; v < rectangle.height_px && rectangle.top_px + v < plane.height_px; ++v)
    for (std::uint32_t u = 0; u < rectangle.width_px && rectangle.left_px + u < plane.width_px; ++u)
      if (mask.covered(rectangle.left_px + u, rectangle.top_px + v))
        out[std::size_t{v} * rectangle.width_px + u] = 255;
  return out;
}

Samples split_samples(const Pixels& pixels, std::size_t measured) {
  const std::size_t texels = std::size_t{pixels.width_px} * pixels.height_px;
  if (pixels.channels == 1) return {pixels.data};
  Samples out(measured, std::vector<std::uint8_t>(texels));
  for (std::size_t c = 0; c < measured; ++c)
    measure_row(pixels.data.data(), pixels.channels, texels, measured, c, out[c].data());
  return out;
}

Samples decode_samples(const PlaneLadder& ladder, std::size_t rung, std::size_t fragment,
                       std::uint64_t max_pixels, std::size_t measured) {
  if (measured > 1) return split_samples(decode_fragment(ladder, rung, fragment, max_pixels), measured);
  return {decode_fragment_luma(ladder, rung, fragment, max_pixels).data};
}

FragmentMeter::FragmentMeter(Samples source, const std::vector<std::uint8_t>& mask, std::uint32_t width,
                             std::uint32_t height) {
  double varying = 0;
  for (const std::vector<std::uint8_t>& channel : source) {
    weights_.push_back(varies(channel, mask) ? 1 : 0);
    varying += weights_.back();
  }
  for (double& weight : weights_)
    weight = varying > 0 ? weight / varying : 1 / static_cast<double>(source.size());
  meters_.reserve(source.size());
  for (std::vector<std::uint8_t>& channel : source)
    meters_.emplace_back(std::move(channel), mask, width, height);
}

Distortion FragmentMeter::against(const Samples& shown) const {
  Distortion out;
  for (std::size_t c = 0; c < meters_.size(); ++c) {
    const Distortion channel = meters_[c].against(shown[c]);
    out.mse += channel.mse / static_cast<double>(meters_.size());
    out.dssim += weights_[c] * channel.dssim;
  }
  return out;
}

std::vector<BilinearPlace> bilinear_places(std::uint32_t first, std::uint32_t count, std::uint32_t size,
                                           std::uint32_t coarse_size) {
  std::vector<BilinearPlace> out;
  for (std::uint32_t k = 0; k < count; ++k)
    out.push_back(place_of(std::min(first + k, size - 1), size, coarse_size));
  return out;
}

Samples scaled_up(const SamplePatch& patch, const std::vector<BilinearPlace>& across,
                  const std::vector<BilinearPlace>& down) {
  const std::uint32_t left = patch.rectangle.left_px, top = patch.rectangle.top_px;
  const std::size_t width = patch.rectangle.width_px, count = across.size();
  Samples out;
  for (const std::vector<std::uint8_t>& samples : patch.samples) {
    const auto stretch = [&](std::uint32_t row, std::vector<std::uint32_t>& to) {
      const std::uint8_t* from = samples.data() + (row - top) * width;
      for (std::size_t k = 0; k < count; ++k) {
        const BilinearPlace& u = across[k];
        to[k] = from[u.first - left] * (256 - u.part) + from[u.second - left] * u.part;
      }
    };
    // Several rows of the result lie between the same two.
    std::vector<std::uint32_t> upper(count), lower(count);
    constexpr std::uint32_t kNone = 0xffffffff;
    std::uint32_t upper_row = kNone, lower_row = kNone;
    std::vector<std::uint8_t>& to = out.emplace_back(count * down.size());
    std::uint8_t* at = to.data();
    for (const BilinearPlace& v : down) {
      if (v.first == lower_row) std::swap(upper, lower), std::swap(upper_row, lower_row);
      if (v.first != upper_row) stretch(upper_row = v.first, upper);
      if (v.second != lower_row) stretch(lower_row = v.second, lower);
      for (std::size_t k = 0; k < count; ++k)
        *at++ = static_cast<std::uint8_t>((upper[k] * (256 - v.part) + lower[k] * v.part + 32768) >> 16);
    }
  }
  return out;
}

SamplePatch preview_samples(const TexturePlane& plane, const std::vector<std::uint8_t>& file) {
  constexpr std::uint64_t kMostPixels = 1u << 26;
  const std::size_t measured = measured_channels(plane);
  const Pixels pixels = measured > 1 ? decode_jpeg(file, kMostPixels) : decode_jpeg_luma(file, kMostPixels);
  return {{0, 0, pixels.width_px, pixels.height_px}, split_samples(pixels, measured)};
}

Samples show_preview(const TexturePlane& plane, const SamplePatch& preview, const TexelRectangle& rectangle) {
  return scaled_up(
      preview,
      bilinear_places(rectangle.left_px, rectangle.width_px, plane.width_px, preview.rectangle.width_px),
      bilinear_places(rectangle.top_px, rectangle.height_px, plane.height_px, preview.rectangle.height_px));
}

}  // namespace texmesh
