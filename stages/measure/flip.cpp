#include "stages/measure/flip.h"

#include "stages/base/float_math.h"
#include "stages/measure/cie_lab.h"

namespace texmesh {
namespace {

constexpr double kPixelsPerDegree = 67.0206432765;  // 0.7 m from a screen 0.7 m wide with 3840 px

using FlipCurve = SampledCurve<16384>;

double sum_of(const FilterKernel& kernel) {
  double sum = 0;
  for (const float k : kernel) sum += static_cast<double>(k);
  return sum;
}

/// exp(-pi^2 x^2 / b), x in degrees: one term of a contrast sensitivity function. Three deviations of the
/// widest term; narrow ones end where single precision no longer sees them.
FilterKernel sensitivity(double b) {
  constexpr double kUnseen = 1e-9;
  FilterKernel out;
  for (int i = -kFilterReach; i <= kFilterReach; ++i) {
    const double x = i / kPixelsPerDegree;
    const double weight = portable::exp(-portable::kPi * portable::kPi * x * x / b);
    if (weight > kUnseen) out.push_back(static_cast<float>(weight));
  }
  return out;
}

/// A term a sqrt(pi / b) exp(-pi^2 z / b) of an eye's filter: its row and its part of the sum over the plane.
struct Term {
  FilterKernel kernel;
  float weight = 0;
};
std::vector<Term> eye_filter(std::initializer_list<std::array<double, 2>> terms) {
  double whole = 0;
  std::vector<Term> out;
  for (const auto& [a, b] : terms) {
    out.push_back({sensitivity(b), 0});
    const double line = sum_of(out.back().kernel);
    whole += a * std::sqrt(portable::kPi / b) * line * line;
  }
  std::size_t i = 0;
  for (const auto& [a, b] : terms)
    out[i++].weight = static_cast<float>(a * std::sqrt(portable::kPi / b) / whole);
  return out;
}

/// Those of Y, Cx, Cz.
const std::array<std::vector<Term>, 3>& eye_filters() {
  static const std::array<std::vector<Term>, 3> filters{eye_filter({{1, 0.0047}}), eye_filter({{1, 0.0053}}),
                                                        eye_filter({{34.1, 0.04}, {13.5, 0.025}})};
  return filters;
}

const FlipCurve& flip_lab_curve() {
  static const FlipCurve curve(lab_root);
  return curve;
}

/// Derivatives of a Gaussian as wide as features that the eye looks for: first (edges), second (points); the
/// weights of either sign sum to 1.
struct FeatureKernels {
  FilterKernel smooth, edge, point;
};
const FeatureKernels& feature_kernels() {
  static const FeatureKernels kernels = [] {
    constexpr double kWidth = 0.082;
    const double deviation = 0.5 * kWidth * kPixelsPerDegree;
    const int radius = static_cast<int>(std::ceil(3 * deviation));
    FeatureKernels k;
    for (int i = -radius; i <= radius; ++i) {
      const double g = portable::exp(-i * i / (2 * deviation * deviation));
      k.smooth.push_back(static_cast<float>(g));
      k.edge.push_back(static_cast<float>(-i * g));
      k.point.push_back(static_cast<float>((i * i / (deviation * deviation) - 1) * g));
    }
    const auto balance = [](FilterKernel& kernel) {
      double positive = 0, negative = 0;
      for (const float v : kernel) (v > 0 ? positive : negative) += std::fabs(static_cast<double>(v));
      for (float& v : kernel) v = static_cast<float>(static_cast<double>(v) / (v > 0 ? positive : negative));
    };
    const double whole = sum_of(k.smooth);
    for (float& v : k.smooth) v = static_cast<float>(static_cast<double>(v) / whole);
    balance(k.edge);
    balance(k.point);
    return k;
  }();
  return kernels;
}

float strength(float x, float y) { return std::sqrt(x * x + y * y); }

/// Y, Cx, Cz, and the luma that features are seen in.
struct Channels {
  Vec3f opponent;
  float luma = 0;
};
Channels channels_of(Vec3f linear) {
  const Vec3d xyz = xyz_of_linear(clamped_colour(linear));
  return {to_float(opponent_of_xyz(xyz)), static_cast<float>(xyz.y)};
}

/// over_white() of what a screen can show next to it.
Vec3f shown_xyz(Vec3f opponent) {
  return over_white(xyz_of_linear(clamped_colour(linear_of_xyz(xyz_of_opponent(to_double(opponent))))));
}

Vec3f flip_lab(Vec3f opponent) { return hunt_lab_of(shown_xyz(opponent), flip_lab_curve()); }

/// Filters a picture's rows as they come, so that all that is in memory at once fits into a cache.
class FlipFilter {
 public:
  FlipFilter(const Picture& picture, const PixelSpans& spans)
      : picture_(picture), spans_(spans), plain_(channels_of(picture.linear[0])) {
    const FeatureKernels& features = feature_kernels();
    for (std::size_t c = 0; c < 3; ++c)
      for (const Term& term : eye_filters()[c])
        eyes_.push_back({c, term, {spans, plain_.opponent[static_cast<int>(c)], term.kernel}});
    for (const FilterKernel* kernel : {&features.smooth, &features.edge, &features.point})
      luma_.emplace_back(spans, plain_.luma, *kernel);
    for (auto& row : opponent_) row.resize(whole_blocks(spans.side_px));
    for (auto& row : {&luma_row_, &part_, &other_}) row->resize(whole_blocks(spans.side_px));
  }

  /// The pixels of row y that `out` keeps. Rows are asked for one after the other.
  void read(std::size_t y, FlipPicture& out) {
    for (; made_ < std::min(spans_.rows.size(), y + kFilterReach + 1); ++made_) make(made_);
    const FlipPicture::Row& row = out.rows[y];
    const std::size_t count = row.last - row.first;
    if (count == 0) return;
    for (auto& channel : opponent_) std::fill_n(channel.begin(), count, 0.f);
    for (const Eye& eye : eyes_) {
      eye.rows.read(y, row.first, row.last, eye.term.kernel, part_.data());
      std::vector<float>& to = opponent_[eye.channel];
      for (std::size_t i = 0; i < count; ++i) to[i] += eye.term.weight * part_[i];
    }
    find_lab(count, out.lab.data() + row.offset);
    for (std::size_t k = 0; k < 2; ++k) {
      luma_[k + 1].read(y, row.first, row.last, feature_kernels().smooth, part_.data());
      luma_[0].read(y, row.first, row.last, derivative(k), other_.data());
      for (std::size_t i = 0; i < count; ++i) out.detail[k][row.offset + i] = strength(part_[i], other_[i]);
    }
  }

  void read_plain(FlipPicture& out) const {
    Vec3f opponent;
    for (const Eye& eye : eyes_)
      opponent[static_cast<int>(eye.channel)] +=
          eye.term.weight * filtered_plain(eye.rows.plain(), eye.term.kernel);
    out.plain_lab = flip_lab(opponent);
    for (std::size_t k = 0; k < 2; ++k)
      out.plain_detail[k] = strength(filtered_plain(luma_[k + 1].plain(), feature_kernels().smooth),
                                     filtered_plain(luma_[0].plain(), derivative(k)));
  }

 private:
  struct Eye {
    std::size_t channel;
    const Term& term;
    FilteredRows rows;
  };
  static const FilterKernel& derivative(std::size_t k) {
    return k == 0 ? feature_kernels().edge : feature_kernels().point;
  }

  /// Of opponent_, which it spoils: arithmetic of several pixels at once, and then the curve.
  void find_lab(std::size_t count, Vec3f* out) {
    float *const a = opponent_[0].data(), *const b = opponent_[1].data(), *const c = opponent_[2].data();
    for (std::size_t i = 0; i < count; ++i) {
      const Vec3f xyz = shown_xyz({a[i], b[i], c[i]});
      a[i] = xyz.x, b[i] = xyz.y, c[i] = xyz.z;
    }
    const FlipCurve& curve = flip_lab_curve();
    for (std::size_t i = 0; i < count; ++i) out[i] = hunt_lab_of({a[i], b[i], c[i]}, curve);
  }

  void make(std::size_t y) {
    const PixelSpans::Row& row = spans_.rows[y];
    const Vec3f* linear = picture_.linear.data() + y * picture_.side_px + row.first;
    float *const a = opponent_[0].data(), *const b = opponent_[1].data(), *const c = opponent_[2].data(),
                 *const luma = luma_row_.data();
    const std::size_t count = row.last - row.first;
    std::size_t first = 0, last = count;
    while (first < count && linear[first] == picture_.linear[0]) ++first;
    while (last > first && linear[last - 1] == picture_.linear[0]) --last;
    const auto put = [&](std::size_t i, const Channels& of) {
      a[i] = of.opponent.x, b[i] = of.opponent.y, c[i] = of.opponent.z;
      luma[i] = of.luma;
    };
    for (std::size_t i = 0; i < first; ++i) put(i, plain_);
    for (std::size_t i = first; i < last; ++i) put(i, channels_of(linear[i]));
    for (std::size_t i = last; i < count; ++i) put(i, plain_);
    for (Eye& eye : eyes_) eye.rows.make(y, opponent_[eye.channel].data());
    for (FilteredRows& rows : luma_) rows.make(y, luma_row_.data());
  }

  const Picture& picture_;
  const PixelSpans& spans_;
  Channels plain_;
  std::vector<Eye> eyes_;
  std::vector<FilteredRows> luma_;  // along x: smooth, edge, point
  std::array<std::vector<float>, 3> opponent_;
  std::vector<float> luma_row_, part_, other_;
  std::size_t made_ = 0;
};

/// FLIP of a block of pixels at a time, which compilers take several of at once.
class FlipBlock {
 public:
  static constexpr std::size_t kSize = 64;
  bool is_full() const { return count_ == kSize; }
  std::size_t count() const { return count_; }
  std::uint32_t column(std::size_t i) const { return column_[i]; }
  float flip(std::size_t i) const { return distance_[i] > 0 ? flip_[i] : 0; }
  void clear() { count_ = 0; }

  void add(std::uint32_t column, Vec3f a, Vec3f b, float edges, float points) {
    const float detail = std::max(std::fabs(edges), std::fabs(points));
    column_[count_] = column;
    distance_[count_] = hyab<float>(a, b);
    exponent_[count_++] = 1 - std::min(1.f, std::sqrt(detail * 0.707106781f));
  }

  // Without square roots, which may set errno and so are taken one at a time.
  void compute() {
    constexpr auto kExponent = static_cast<float>(kHyabExponent);
    static const float greatest = power(largest_hyab<float>(flip_lab_curve()), kExponent);
    const float largest = greatest;
    for (std::size_t i = 0; i < kSize; ++i)
      flip_[i] = power(remapped_difference(power(distance_[i], kExponent), largest), exponent_[i]);
  }

 private:
  /// base^exponent, of next to nothing where the base is 0.
  static float power(float base, float exponent) {
    return exp2_of(exponent * log2_of(base > 1e-30f ? base : 1e-30f));
  }
  std::size_t count_ = 0;
  std::array<std::uint32_t, kSize> column_{};
  std::array<float, kSize> distance_{}, exponent_{}, flip_{};
};

/// What the comparison reads of one picture at one pixel.
struct Seen {
  Vec3f lab;
  std::array<float, 2> detail;
  bool covered;
};
Seen seen_at(const FlipPicture& picture, const FlipPicture::Row& row, std::uint32_t x) {
  if (x < row.first || x >= row.last) return {picture.plain_lab, picture.plain_detail, false};
  const std::size_t i = row.offset + (x - row.first);
  return {picture.lab[i], {picture.detail[0][i], picture.detail[1][i]}, picture.covered[i] != 0};
}

/// Calls visit(x, y, FLIP) for every pixel that either picture covers, row by row.
void for_each_flip(const FlipPicture& reference, const FlipPicture& test, auto&& visit) {
  FlipBlock block;
  for (std::size_t y = 0; y < reference.rows.size(); ++y) {
    const auto finish = [&] {
      block.compute();
      for (std::size_t i = 0; i < block.count(); ++i) visit(std::size_t{block.column(i)}, y, block.flip(i));
      block.clear();
    };
    const FlipPicture::Row &a = reference.rows[y], &b = test.rows[y];
    const bool none = a.first == a.last;
    const std::uint32_t first = none ? b.first : b.first == b.last ? a.first : std::min(a.first, b.first);
    for (std::uint32_t x = first; x < std::max(a.last, b.last); ++x) {
      const Seen r = seen_at(reference, a, x), t = seen_at(test, b, x);
      if (!r.covered && !t.covered) continue;
      block.add(x, r.lab, t.lab, r.detail[0] - t.detail[0], r.detail[1] - t.detail[1]);
      if (block.is_full()) finish();
    }
    if (block.count() > 0) finish();
  }
}

/// Around the pixels of a row that either picture covers.
FlipPicture::Row compared_columns(const FlipPicture& reference, const Picture& test, std::size_t y) {
  const std::uint8_t* covered = test.covered.data() + y * test.side_px;
  const FlipPicture::Row& other = reference.rows[y];
  const auto shows = [&](std::uint32_t x) {
    return covered[x] ||
           (x >= other.first && x < other.last && reference.covered[other.offset + (x - other.first)]);
  };
  FlipPicture::Row row{0, test.side_px, 0};
  while (row.first < row.last && !shows(row.first)) ++row.first;
  while (row.last > row.first && !shows(row.last - 1)) --row.last;
  return row;
}

/// The pixels whose rows are given.
void filter_rows(const Picture& picture, const PixelSpans& spans, FlipPicture& out) {
  const std::size_t count = out.rows.back().offset + (out.rows.back().last - out.rows.back().first);
  out.lab.resize(count);
  for (std::vector<float>& detail : out.detail) detail.resize(count);
  for (std::size_t y = 0; y < out.rows.size(); ++y) {
    const auto covered = picture.covered.begin() + static_cast<std::ptrdiff_t>(y * picture.side_px);
    out.covered.insert(out.covered.end(), covered + out.rows[y].first, covered + out.rows[y].last);
  }
  FlipFilter filter(picture, spans);
  for (std::size_t y = 0; y < out.rows.size(); ++y) filter.read(y, out);
  filter.read_plain(out);
}

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
    rows_.read(y, spans_.rows[y].first, spans_.rows[y].last, window(), row_.data());
    return row_;
  }

 private:
  const PixelSpans& spans_;
  FilteredRows rows_;
  std::vector<float> row_;
  std::size_t made_ = 0;
};

float linear_luma(Vec3f c) {
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

void FlipSum::add(const FlipSum& other) {
  sum += other.sum;
  pixels += other.pixels;
  for (std::size_t i = 0; i < histogram.size(); ++i) histogram[i] += other.histogram[i];
}

double FlipSum::percentile(double part) const {
  const double rank = part * static_cast<double>(pixels);
  double below = 0;
  for (std::size_t i = 0; i < histogram.size(); ++i) {
    const double here = histogram[i];
    if (here > 0 && below + here >= rank)
      return i == 0 ? 0 : (static_cast<double>(i - 1) + (rank - below) / here) / kFlipSteps;
    below += here;
  }
  return 0;
}

FlipPicture prepare_flip(const Picture& picture) {
  FlipPicture out;
  if (picture.linear.empty()) return out;
  const PixelSpans spans = shown_spans(picture);
  for (const PixelSpans::Row& row : spans.rows) out.rows.push_back({row.first, row.last, row.offset});
  filter_rows(picture, spans, out);
  return out;
}

FlipSum compare_flip(const FlipPicture& reference, const FlipPicture& test) {
  FlipSum sum;
  for_each_flip(reference, test, [&](std::size_t, std::size_t, float flip) {
    const auto step = static_cast<std::size_t>(std::min(flip * kFlipSteps, kFlipSteps - 1.f));
    ++sum.pixels;
    ++sum.histogram[flip > 0 ? step + 1 : 0];
    sum.sum += static_cast<double>(flip);
  });
  return sum;
}

FlipSum compare_flip(const FlipPicture& reference, const Picture& test, const PixelSpans& spans) {
  FlipPicture filtered;
  if (test.linear.empty()) return compare_flip(reference, filtered);
  std::size_t count = 0;
  for (std::size_t y = 0; y < spans.rows.size(); ++y) {
    FlipPicture::Row row = compared_columns(reference, test, y);
    row.first = std::max(row.first, spans.rows[y].first), row.last = std::min(row.last, spans.rows[y].last);
    if (row.first >= row.last) row.first = row.last = 0;
    row.offset = std::exchange(count, count + (row.last - row.first));
    filtered.rows.push_back(row);
  }
  filter_rows(test, spans, filtered);
  return compare_flip(reference, filtered);
}

FlipSum compare_flip(const FlipPicture& reference, const Picture& test) {
  return compare_flip(reference, test, shown_spans(test));
}

std::vector<float> flip_map(const FlipPicture& reference, const FlipPicture& test) {
  const std::size_t side = reference.rows.size();
  std::vector<float> map(side * side, 0);
  for_each_flip(reference, test, [&](std::size_t x, std::size_t y, float flip) { map[y * side + x] = flip; });
  return map;
}

double flip_of(const FlipPicture& reference, const FlipPicture& test) {
  return compare_flip(reference, test).mean();
}

LumaPicture prepare_luma(const Picture& picture) { return prepare_luma(picture, shown_spans(picture)); }

LumaPicture prepare_luma(const Picture& picture, const PixelSpans& spans) {
  LumaPicture out;
  out.covered = picture.covered;
  if (picture.linear.empty()) return out;
  out.spans = spans;
  for (SpanImage* image : {&out.luma, &out.mean, &out.square_mean}) image->values.resize(out.spans.count);
  out.luma.plain = linear_luma(picture.linear[0]);
  Windowed mean(out.spans, out.luma.plain), square_mean(out.spans, out.luma.plain * out.luma.plain);
  std::vector<float> squares(picture.side_px);
  const auto values_of = [&](std::size_t y) {
    const PixelSpans::Row& row = out.spans.rows[y];
    float* const luma = out.luma.values.data() + row.offset;
    for (std::size_t x = row.first; x < row.last; ++x)
      luma[x - row.first] = linear_luma(picture.linear[y * picture.side_px + x]);
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
