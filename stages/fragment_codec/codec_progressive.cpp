// Progressive JPEG: one file per fragment, whose scans refine all coefficients bit by bit; a rung is a
// prefix.
#include <algorithm>

#include "format/base/errors.h"
#include "stages/base/parallel.h"
#include "stages/fragment_codec/codec_list.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/jpeg_coder.h"
#include "stages/jpeg/jpeg_stream.h"

namespace texmesh {
namespace {

// Windows that a rung's quality is measured on: each takes some dozen encodes.
constexpr std::size_t kMeasuredWindows = 16;

/// How many scans each rung has, see progressive_scans(): after every pass over luma (with the DC bit that
/// goes with it) and after every pass over chroma.
std::vector<std::size_t> scans_of_rungs(std::uint32_t channels) {
  if (channels == 1) return {2, 4, 6, 8, 9};
  return {2, 4, 6, 8, 10, 12, 14, 16, 17, 19};
}

JpegKind progressive_kind(const PlaneCoding& plane, int quality) {
  JpegKind kind = jpeg_kind(plane, quality);
  kind.progressive = true;
  return kind;
}

double squared_error(const PixelWindow& window, const Pixels& decoded) {
  double sum = 0;
  for (std::uint32_t y = 0; y < window.height_px; ++y) {
    std::uint64_t row = 0;
    const std::uint8_t *a = window.data + y * window.stride_bytes, *b = decoded.at(0, y);
    for (std::size_t k = 0; k < std::size_t{window.width_px} * decoded.channels; ++k)
      row += static_cast<std::uint64_t>((a[k] - b[k]) * (a[k] - b[k]));
    sum += static_cast<double>(row);
  }
  return sum;
}

std::uint64_t area(const PixelWindow& window) { return std::uint64_t{window.width_px} * window.height_px; }

class ProgressiveCodec : public TextureCodec {
 public:
  /// The plane's highest quality is that of the whole file.
  explicit ProgressiveCodec(const PlaneCoding& plane)
      : plane_(plane), quality_(plane.qualities.back()), scans_(scans_of_rungs(plane.channels)) {}
  Codec id() const override { return Codec::kJpegProgressive; }

  std::vector<CodecRung> train(std::span<const PixelWindow> sample, const RunContext& context) override {
    std::vector<CodecRung> rungs(scans_.size());
    JpegCoder coder(progressive_kind(plane_, quality_));
    rungs[0].table_stream = coder.head_stream(plane_.fragment_width_px, plane_.fragment_height_px);
    const auto measured = sample.first(std::min(sample.size(), kMeasuredWindows));
    const std::vector<double> errors = errors_of_rungs(measured);
    parallel_for(context, rungs.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r)
        rungs[r].quality = r + 1 == rungs.size() ? quality_ : equal_quality(errors[r], measured);
    });
    make_strictly_rising(rungs);
    return rungs;
  }

  std::unique_ptr<FragmentEncoder> encoder(std::span<const std::size_t> rungs) const override {
    return std::make_unique<Encoder>(*this, rungs.empty() ? scans_.size() : rungs.size());
  }

 private:
  /// Squared error of the sample at every rung.
  std::vector<double> errors_of_rungs(std::span<const PixelWindow> sample) const {
    std::vector<double> errors(scans_.size());
    Encoder encoder(*this, scans_.size());
    JpegCoder coder(progressive_kind(plane_, quality_));
    for (const PixelWindow& window : sample) {
      std::vector<std::vector<std::uint8_t>> streams(scans_.size());
      encoder.encode(window, streams);
      const auto head = coder.head_stream(window.width_px, window.height_px);
      std::vector<std::span<const std::uint8_t>> parts;
      for (std::size_t r = 0; r < scans_.size(); ++r) {
        parts.emplace_back(streams[r]);
        errors[r] += squared_error(window, decode_jpeg(join_fragment(id(), head, parts), area(window)));
      }
    }
    return errors;
  }

  /// The quality at which baseline JPEG has the same squared error: what a rung is worth to a client that
  /// compares it with others. By bisection; 1 to the whole file's.
  int equal_quality(double error, std::span<const PixelWindow> sample) const {
    int low = 1, high = quality_;
    while (low < high) {
      const int middle = (low + high) / 2;
      JpegCoder coder(jpeg_kind(plane_, middle));
      double sum = 0;
      for (const PixelWindow& window : sample)
        sum += squared_error(window, decode_jpeg(coder.complete_as_is(window), area(window)));
      if (sum <= error)
        high = middle;
      else
        low = middle + 1;
    }
    return low;
  }

  static void make_strictly_rising(std::vector<CodecRung>& rungs) {
    const int last = rungs.back().quality;
    for (std::size_t r = 0; r < rungs.size(); ++r) {
      const int least = r == 0 ? 1 : rungs[r - 1].quality + 1;
      rungs[r].quality = std::clamp(rungs[r].quality, least, last - static_cast<int>(rungs.size() - 1 - r));
    }
  }

  class Encoder : public FragmentEncoder {
   public:
    Encoder(const ProgressiveCodec& codec, std::size_t rungs)
        : scans_(codec.scans_), rungs_(rungs), coder_(progressive_kind(codec.plane_, codec.quality_)) {}
    void encode(const PixelWindow& fragment, std::span<std::vector<std::uint8_t>> streams) override {
      body_.clear();
      coder_.append_body(fragment, body_);
      const std::vector<std::size_t> ends = scan_ends(body_);
      if (ends.size() != scans_.back() || ends.back() != body_.size())
        throw StageError("ladder", "progressive file", std::to_string(scans_.back()) + " scans",
                         std::to_string(ends.size()));
      std::size_t begin = 0;
      for (std::size_t r = 0; r < rungs_; ++r) {
        const std::size_t end = ends[scans_[r] - 1];
        streams[r].insert(streams[r].end(), body_.begin() + static_cast<std::ptrdiff_t>(begin),
                          body_.begin() + static_cast<std::ptrdiff_t>(end));
        begin = end;
      }
    }

   private:
    const std::vector<std::size_t>& scans_;
    std::size_t rungs_;
    JpegCoder coder_;
    std::vector<std::uint8_t> body_;
  };

  PlaneCoding plane_;
  int quality_;
  std::vector<std::size_t> scans_;
};

}  // namespace

std::unique_ptr<TextureCodec> make_progressive_codec(const PlaneCoding& plane) {
  const int rungs = static_cast<int>(scans_of_rungs(plane.channels).size());
  if (plane.qualities.back() < rungs)
    throw StageError("ladder", "highest quality",
                     "at least " + std::to_string(rungs) + " for progressive files",
                     std::to_string(plane.qualities.back()));
  return std::make_unique<ProgressiveCodec>(plane);
}

}  // namespace texmesh
