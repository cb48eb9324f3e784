#include "stages/measure/image_compare.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "format/base/portable_math.h"
#include "format/base/srgb.h"
#include "stages/measure/cie_lab.h"
#include "stages/measure/picture.h"
#include "stages/measure/sampled_curve.h"

namespace texmesh {
namespace {

using Curve = SampledCurve<8192>;  // finer than 8-bit pictures can show

const Curve& srgb_curve() {
  static const Curve curve(srgb_of_light);
  return curve;
}
const Curve& lab_curve() {
  static const Curve curve(lab_root);
  return curve;
}

class Gaussian {
 public:
  Gaussian(double deviation, int radius) : radius_(radius) {
    double sum = 0;
    for (int i = -radius; i <= radius; ++i) sum += portable::exp(-i * i / (2 * deviation * deviation));
    for (int i = 0; i <= radius; ++i)
      weights_.push_back(static_cast<float>(portable::exp(-i * i / (2 * deviation * deviation)) / sum));
  }

  // Edges are replicated.
  void blur(std::vector<float>& image, std::uint32_t side) const {
    const int n = static_cast<int>(side);
    std::vector<float> line(side), sums(side);
    auto pass = [&](std::size_t start, std::size_t stride) {
      for (std::size_t i = 0; i < side; ++i) line[i] = image[start + i * stride];
      for (int i = 0; i < n; ++i) {
        float sum = weights_[0] * line[static_cast<std::size_t>(i)];
        for (int k = 1; k <= radius_; ++k)
          sum += weights_[static_cast<std::size_t>(k)] *
                 (line[static_cast<std::size_t>(std::max(0, i - k))] +
                  line[static_cast<std::size_t>(std::min(n - 1, i + k))]);
        sums[static_cast<std::size_t>(i)] = sum;
      }
      for (std::size_t i = 0; i < side; ++i) image[start + i * stride] = sums[i];
    };
    for (std::size_t y = 0; y < side; ++y) pass(y * side, 1);
    for (std::size_t x = 0; x < side; ++x) pass(x, side);
  }

 private:
  int radius_;
  std::vector<float> weights_;
};

const measure::Kernel& window() {
  static const measure::Kernel kernel = [] {
    constexpr double kDeviation = 1.5;
    measure::Kernel k;
    double sum = 0;
    for (int i = -5; i <= 5; ++i) sum += portable::exp(-i * i / (2 * kDeviation * kDeviation));
    for (int i = -5; i <= 5; ++i)
      k.push_back(static_cast<float>(portable::exp(-i * i / (2 * kDeviation * kDeviation)) / sum));
    return k;
  }();
  return kernel;
}

/// Values under the window, row by row as they come: all that is in memory at once fits into a cache.
class Windowed {
 public:
  Windowed(const measure::PixelSpans& spans, float plain)
      : spans_(spans), rows_(spans, plain, window()), row_(measure::whole_blocks(spans.side_px)) {}
  float plain() const { return measure::filtered_plain(rows_.plain(), window()); }
  /// Row y. Rows are asked for one after the other; `values_of(row)` gives those of its span.
  template <class ValuesOf>
  const std::vector<float>& row(std::size_t y, ValuesOf&& values_of) {
    for (; made_ < std::min(spans_.rows.size(), y + window().size() / 2 + 1); ++made_)
      rows_.make(made_, values_of(made_));
    rows_.read(y, window(), row_.data());
    return row_;
  }

 private:
  const measure::PixelSpans& spans_;
  measure::FilteredRows rows_;
  std::vector<float> row_;
  std::size_t made_ = 0;
};

float luma_of(Vec3f c) {
  return 0.2126f * srgb_curve()(c.x) + 0.7152f * srgb_curve()(c.y) + 0.0722f * srgb_curve()(c.z);
}

struct Windows {
  float a_mean, b_mean, a_square, b_square, product;
};
double ssim_of(const Windows& w) {
  constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;
  const double a = static_cast<double>(w.a_mean), b = static_cast<double>(w.b_mean);
  const double va = static_cast<double>(w.a_square) - a * a, vb = static_cast<double>(w.b_square) - b * b;
  const double covariance = static_cast<double>(w.product) - a * b;
  return (2 * a * b + kC1) * (2 * covariance + kC2) / ((a * a + b * b + kC1) * (va + vb + kC2));
}

double compressed(double distance) { return distance > 0 ? portable::pow(distance, kHyabExponent) : 0; }

double colour_difference(Vec3f a, Vec3f b) {
  static const double largest = compressed(largest_hyab<double>(lab_curve()));
  return remapped_difference(compressed(hyab<double>(a, b)), largest);
}

std::vector<Vec3f> eye_lab(const Picture& picture) {
  const std::size_t count = picture.linear.size();
  std::array<std::vector<float>, 3> opponent;  // Y, Cx, Cz
  for (auto& channel : opponent) channel.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f colour = to_float(opponent_of_xyz(xyz_of_linear(clamped_colour(picture.linear[i]))));
    for (int c = 0; c < 3; ++c) opponent[static_cast<std::size_t>(c)][i] = colour[c];
  }
  static const Gaussian kAchromatic(1.03, 3), kRedGreen(1.10, 3), kBlueYellow(2.9, 8);
  kAchromatic.blur(opponent[0], picture.side_px);
  kRedGreen.blur(opponent[1], picture.side_px);
  kBlueYellow.blur(opponent[2], picture.side_px);
  std::vector<Vec3f> lab(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f colour{opponent[0][i], opponent[1][i], opponent[2][i]};
    lab[i] = hunt_lab(xyz_of_opponent(to_double(colour)), lab_curve());
  }
  return lab;
}

}  // namespace

LumaPicture prepare_luma(const Picture& picture) {
  return prepare_luma(picture, measure::shown_spans(picture));
}

LumaPicture prepare_luma(const Picture& picture, const measure::PixelSpans& spans) {
  LumaPicture out;
  out.covered = picture.covered;
  if (picture.linear.empty()) return out;
  out.spans = spans;
  for (measure::SpanImage* image : {&out.luma, &out.mean, &out.square_mean})
    image->values.resize(out.spans.count);
  out.luma.plain = luma_of(picture.linear[0]);
  Windowed mean(out.spans, out.luma.plain), square_mean(out.spans, out.luma.plain * out.luma.plain);
  std::vector<float> squares(picture.side_px);
  const auto values_of = [&](std::size_t y) {
    const measure::PixelSpans::Row& row = out.spans.rows[y];
    float* const luma = out.luma.values.data() + row.offset;
    for (std::size_t x = row.first; x < row.last; ++x)
      luma[x - row.first] = luma_of(picture.linear[y * picture.side_px + x]);
    return luma;
  };
  const auto squares_of = [&](std::size_t y) {
    const measure::PixelSpans::Row& row = out.spans.rows[y];
    const float* const luma = out.luma.values.data() + row.offset;
    for (std::size_t i = 0; i < row.last - row.first; ++i) squares[i] = luma[i] * luma[i];
    return squares.data();
  };
  for (std::size_t y = 0; y < out.spans.rows.size(); ++y) {
    const measure::PixelSpans::Row& row = out.spans.rows[y];
    const std::size_t count = row.last - row.first;
    std::copy_n(mean.row(y, values_of).begin(), count, out.mean.values.data() + row.offset);
    std::copy_n(square_mean.row(y, squares_of).begin(), count, out.square_mean.values.data() + row.offset);
  }
  out.mean.plain = mean.plain();
  out.square_mean.plain = square_mean.plain();
  return out;
}

ComparedPicture prepare_comparison(const Picture& picture) {
  return {prepare_luma(picture), eye_lab(picture)};
}

PictureDifference compare_luma(const LumaPicture& reference, const LumaPicture& test) {
  const measure::PixelSpans both = measure::union_of(reference.spans, test.spans);
  Windowed products(both, reference.luma.plain * test.luma.plain);
  std::vector<float> row_products(both.side_px);
  const auto products_of = [&](std::size_t at) {
    const auto y = static_cast<std::uint32_t>(at);
    const measure::PixelSpans::Row& row = both.rows[y];
    for (std::uint32_t x = row.first; x < row.last; ++x)
      row_products[x - row.first] = reference.luma.at(reference.spans, x, y) * test.luma.at(test.spans, x, y);
    return row_products.data();
  };
  PictureDifference sum;
  for (std::uint32_t y = 0; y < both.rows.size(); ++y) {
    const measure::PixelSpans::Row& row = both.rows[y];
    const std::vector<float>& product = products.row(y, products_of);
    for (std::uint32_t x = row.first; x < row.last; ++x) {
      const std::size_t at = std::size_t{y} * both.side_px + x;
      if (!reference.covered[at] && !test.covered[at]) continue;
      sum.ssim += ssim_of({reference.mean.at(reference.spans, x, y), test.mean.at(test.spans, x, y),
                           reference.square_mean.at(reference.spans, x, y),
                           test.square_mean.at(test.spans, x, y), product[x - row.first]});
      ++sum.pixels;
    }
  }
  return sum;
}

PictureDifference compare_pictures(const ComparedPicture& reference, const ComparedPicture& test) {
  PictureDifference sum = compare_luma(reference, test);
  for (std::size_t i = 0; i < reference.lab.size(); ++i)
    if (reference.covered[i] || test.covered[i])
      sum.difference += colour_difference(reference.lab[i], test.lab[i]);
  return sum;
}

}  // namespace texmesh
