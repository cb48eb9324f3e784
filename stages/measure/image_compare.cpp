#include "stages/measure/image_compare.h"

#include "format/base/srgb.h"
#include "stages/base/float_math.h"

namespace texmesh {
namespace {

using Curve = SampledCurve<8192>;  // finer than 8-bit pictures can show

const Curve& srgb_curve() {
  static const Curve curve(srgb_of_light);
  return curve;
}
const FilterKernel& window() {
  static const FilterKernel kernel = [] {
    constexpr double kDeviation = 1.5;
    FilterKernel k;
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
  Windowed(const PixelSpans& spans, float plain)
      : spans_(spans), rows_(spans, plain, window()), row_(whole_blocks(spans.side_px)) {}
  float plain() const { return filtered_plain(rows_.plain(), window()); }
  /// Row y. Rows are asked for one after the other; `values_of(row)` gives those of its span.
  const std::vector<float>& row(std::size_t y, auto&& values_of) {
    for (; made_ < std::min(spans_.rows.size(), y + window().size() / 2 + 1); ++made_)
      rows_.make(made_, values_of(made_));
    rows_.read(y, window(), row_.data());
    return row_;
  }

 private:
  const PixelSpans& spans_;
  FilteredRows rows_;
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

}  // namespace

LumaPicture prepare_luma(const Picture& picture) { return prepare_luma(picture, shown_spans(picture)); }

LumaPicture prepare_luma(const Picture& picture, const PixelSpans& spans) {
  LumaPicture out;
  out.covered = picture.covered;
  if (picture.linear.empty()) return out;
  out.spans = spans;
  for (SpanImage* image : {&out.luma, &out.mean, &out.square_mean}) image->values.resize(out.spans.count);
  out.luma.plain = luma_of(picture.linear[0]);
  Windowed mean(out.spans, out.luma.plain), square_mean(out.spans, out.luma.plain * out.luma.plain);
  std::vector<float> squares(picture.side_px);
  const auto values_of = [&](std::size_t y) {
    const PixelSpans::Row& row = out.spans.rows[y];
    float* const luma = out.luma.values.data() + row.offset;
    for (std::size_t x = row.first; x < row.last; ++x)
      luma[x - row.first] = luma_of(picture.linear[y * picture.side_px + x]);
    return luma;
  };
  const auto squares_of = [&](std::size_t y) {
    const PixelSpans::Row& row = out.spans.rows[y];
    const float* const luma = out.luma.values.data() + row.offset;
    for (std::size_t i = 0; i < row.last - row.first; ++i) squares[i] = luma[i] * luma[i];
    return squares.data();
  };
  for (std::size_t y = 0; y < out.spans.rows.size(); ++y) {
    const PixelSpans::Row& row = out.spans.rows[y];
    const std::size_t count = row.last - row.first;
    std::copy_n(mean.row(y, values_of).begin(), count, out.mean.values.data() + row.offset);
    std::copy_n(square_mean.row(y, squares_of).begin(), count, out.square_mean.values.data() + row.offset);
  }
  out.mean.plain = mean.plain();
  out.square_mean.plain = square_mean.plain();
  return out;
}

PictureDifference compare_luma(const LumaPicture& reference, const LumaPicture& test) {
  const PixelSpans both = union_of(reference.spans, test.spans);
  Windowed products(both, reference.luma.plain * test.luma.plain);
  std::vector<float> row_products(both.side_px);
  const auto products_of = [&](std::size_t at) {
    const auto y = static_cast<std::uint32_t>(at);
    const PixelSpans::Row& row = both.rows[y];
    for (std::uint32_t x = row.first; x < row.last; ++x)
      row_products[x - row.first] = reference.luma.at(reference.spans, x, y) * test.luma.at(test.spans, x, y);
    return row_products.data();
  };
  PictureDifference sum;
  for (std::uint32_t y = 0; y < both.rows.size(); ++y) {
    const PixelSpans::Row& row = both.rows[y];
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

}  // namespace texmesh
