#include "stages/measure/pixel_spans.h"

#include <algorithm>

namespace texmesh::measure {
namespace {

constexpr std::size_t kBlock = 8;  // pixels that a loop of vectors takes at once

std::size_t rounded_up(std::size_t n) { return (n + kBlock - 1) / kBlock * kBlock; }

/// out[i] = sum over k of kernel[k] * line k[i]; `line_at(k)` points at its value for i = 0. Reads and writes
/// whole blocks. Every sum runs by rising k, so blocks change no bit.
template <class LineAt>
void add_lines(const Kernel& kernel, LineAt&& line_at, std::size_t count, float* out) {
  for (std::size_t i = 0; i < count; i += kBlock) {
    float sum[kBlock] = {};
    for (std::size_t k = 0; k < kernel.size(); ++k) {
      const float* line = line_at(k) + i;
      const float weight = kernel[k];
      for (std::size_t j = 0; j < kBlock; ++j) sum[j] += line[j] * weight;
    }
    for (std::size_t j = 0; j < kBlock; ++j) out[i + j] = sum[j];
  }
}

float filtered_plain(float plain, const Kernel& kernel) {
  float sum = 0;
  for (const float weight : kernel) sum += plain * weight;
  return sum;
}

/// Rows filtered along x, as many as the filter along y sees at once. All have the picture's whole width.
class FilteredRows {
 public:
  FilteredRows(const SpanImage& image, const PixelSpans& spans, const Kernel& kernel, std::size_t kept)
      : image_(image),
        spans_(spans),
        kernel_(kernel),
        kept_(kept),
        plain_(filtered_plain(image.plain, kernel)) {
    width_ = rounded_up(spans.side_px) + kBlock;
    padded_.resize(width_ + 2 * kFilterReach + kBlock);
    lines_.assign(kept * width_, plain_);
    written_.resize(kept);
  }
  float plain() const { return plain_; }
  const float* line(std::size_t y) const { return lines_.data() + y % kept_ * width_; }

  void make(std::size_t y) {
    float* out = lines_.data() + y % kept_ * width_;
    PixelSpans::Row& old = written_[y % kept_];
    std::fill(out + old.first, out + old.last, plain_);
    const PixelSpans::Row& row = spans_.rows[y];
    old = row;
    if (row.first == row.last) return;
    const std::size_t count = row.last - row.first, radius = kernel_.size() / 2;
    const float* values = image_.values.data() + row.offset;
    const float before = row.first == 0 ? values[0] : image_.plain,
                behind = row.last == spans_.side_px ? values[count - 1] : image_.plain;
    std::fill_n(padded_.begin(), radius, before);
    std::copy_n(values, count, padded_.begin() + static_cast<std::ptrdiff_t>(radius));
    std::fill_n(padded_.begin() + static_cast<std::ptrdiff_t>(radius + count), radius + kBlock, behind);
    result_.resize(rounded_up(count));
    add_lines(
        kernel_, [&](std::size_t k) { return padded_.data() + k; }, count, result_.data());
    std::copy_n(result_.begin(), count, out + row.first);
  }

 private:
  const SpanImage& image_;
  const PixelSpans& spans_;
  const Kernel& kernel_;
  std::size_t kept_, width_ = 0;
  float plain_;
  std::vector<float> padded_, result_, lines_;
  std::vector<PixelSpans::Row> written_;
};

/// The columns that are not plain, without what lies around them.
PixelSpans::Row shown_columns(const Picture& picture, std::size_t y) {
  const std::size_t side = picture.side_px;
  const Vec3f* linear = picture.linear.data() + y * side;
  const std::uint8_t* covered = picture.covered.data() + y * side;
  const Vec3f plain = picture.linear[0];
  const auto shows = [&](std::size_t x) { return covered[x] || !(linear[x] == plain); };
  std::size_t first = 0, last = side;
  while (first < side && !shows(first)) ++first;
  if (first == side) return {};
  while (!shows(last - 1)) --last;
  return {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(last), 0};
}

void number_pixels(PixelSpans& spans) {
  for (PixelSpans::Row& row : spans.rows) {
    row.offset = spans.count;
    spans.count += row.last - row.first;
  }
}

void extend(PixelSpans::Row& row, const PixelSpans::Row& by) {
  if (by.first == by.last) return;
  row.first = row.first == row.last ? by.first : std::min(row.first, by.first);
  row.last = std::max(row.last, by.last);
}

}  // namespace

PixelSpans shown_spans(const Picture& picture) {
  constexpr std::uint32_t kReach = kFilterReach;
  PixelSpans spans;
  spans.side_px = picture.side_px;
  std::vector<PixelSpans::Row> shown(picture.side_px);
  for (std::size_t y = 0; y < shown.size(); ++y) {
    PixelSpans::Row& row = shown[y] = shown_columns(picture, y);
    if (row.first == row.last) continue;
    row.first = std::max(row.first, kReach) - kReach;
    row.last = std::min(row.last + kReach, picture.side_px);
  }
  spans.rows.resize(shown.size());
  for (std::size_t y = 0; y < shown.size(); ++y)
    for (std::size_t k = std::max<std::size_t>(y, kReach) - kReach;
         k < std::min<std::size_t>(y + kReach + 1, shown.size()); ++k)
      extend(spans.rows[y], shown[k]);
  number_pixels(spans);
  return spans;
}

PixelSpans union_of(const PixelSpans& a, const PixelSpans& b) {
  PixelSpans out;
  out.side_px = a.side_px;
  out.rows.resize(a.rows.size());
  for (std::size_t y = 0; y < out.rows.size(); ++y) {
    extend(out.rows[y], a.rows[y]);
    extend(out.rows[y], b.rows[y]);
  }
  number_pixels(out);
  return out;
}

SpanImage filtered(const SpanImage& image, const PixelSpans& spans, const Kernel& along_x,
                   const Kernel& along_y) {
  const std::size_t rows = spans.rows.size(), radius = along_y.size() / 2;
  FilteredRows lines(image, spans, along_x, along_y.size());
  SpanImage out{std::vector<float>(spans.count), filtered_plain(lines.plain(), along_y)};
  std::vector<float> result(rounded_up(spans.side_px));
  std::size_t made = 0;
  for (std::size_t y = 0; y < rows; ++y) {
    for (; made < std::min(rows, y + radius + 1); ++made) lines.make(made);
    const PixelSpans::Row& row = spans.rows[y];
    if (row.first == row.last) continue;
    const auto line_at = [&](std::size_t k) {
      const std::size_t at = std::min(std::max(y + k, radius) - radius, rows - 1);
      return lines.line(at) + row.first;
    };
    add_lines(along_y, line_at, row.last - row.first, result.data());
    std::copy_n(result.begin(), row.last - row.first,
                out.values.begin() + static_cast<std::ptrdiff_t>(row.offset));
  }
  return out;
}

}  // namespace texmesh::measure
