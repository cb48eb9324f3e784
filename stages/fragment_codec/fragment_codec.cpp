// How fragments are coded, one class a codec.
// - Baseline JPEG: every rung has Huffman tables trained on a sample of the plane, and everything that
//   fragments have in common stands in the rung's table stream. Fragments with uncovered texels are coded by
//   MaskedJpeg, and all of them at the finest quality; the others by libjpeg.
// - Progressive JPEG: one file per fragment, whose scans refine all coefficients bit by bit; a rung is a
//   prefix.
// - Lossy WebP: a complete file per fragment and rung.
#include "stages/fragment_codec/fragment_codec.h"

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"
#include "stages/image/webp.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/masked_jpeg.h"

namespace texmesh {
namespace {

constexpr std::array<int, 3> kQualities{30, 75, 93};
constexpr std::size_t kMostWindows = 32;
constexpr double kMostTimesLeastError = 2;
constexpr int kComparedErrors = 9;
constexpr double kNoError = 1e-9;

constexpr CodingSpace kApart{true, Subsampling::k444, false};
constexpr std::array<CodingSpace, 4> kOthers{{{false, Subsampling::k444, false},
                                              {false, Subsampling::k420, false},
                                              {true, Subsampling::k444, true},
                                              {true, Subsampling::k444, false, true}}};

/// Logarithms of a space's bits and errors, by quality.
struct RateCurve {
  std::array<double, kQualities.size()> bits{}, error{};
  double least_error() const { return *std::ranges::min_element(error); }
  double most_error() const { return *std::ranges::max_element(error); }
  /// At an error between the least and the most.
  double bits_at(double wanted) const {
    for (std::size_t k = 1; k < bits.size(); ++k) {
      const double from = error[k - 1], to = error[k];
      if (wanted < to || from <= to) continue;
      const double part = std::clamp((from - wanted) / (from - to), 0.0, 1.0);
      return bits[k - 1] + part * (bits[k] - bits[k - 1]);
    }
    return bits.back();
  }
};

/// The length between two vectors' ends on the unit sphere: their angle where it is small.
double chord(const std::uint8_t* a, const std::uint8_t* b) {
  if (a[0] == b[0] && a[1] == b[1] && a[2] == b[2]) return 0;
  int aa = 0, bb = 0, ab = 0;
  for (int c = 0; c < 3; ++c) {
    const int x = 2 * a[c] - 255, y = 2 * b[c] - 255;
    aa += x * x, bb += y * y, ab += x * y;
  }
  const double cosine = ab / std::sqrt(static_cast<double>(aa) * bb);  // 255 is odd, so that no vector is 0
  return std::sqrt(std::max(0.0, 2 - 2 * cosine));
}

double squares(const std::uint8_t* a, const std::uint8_t* b) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) sum += (a[c] - b[c]) * (a[c] - b[c]);
  return sum;
}

/// Summed over the covered texels of a window.
double error_of(DataKind kind, const PixelWindow& window, const Pixels& decoded) {
  double sum = 0;
  for (std::uint32_t y = 0; y < window.height_px; ++y)
    for (std::uint32_t x = 0; x < window.width_px; ++x) {
      if (!window.coverage.mask.empty() && !window.coverage.covered(x, y)) continue;
      const std::uint8_t *a = window.data + y * window.stride_bytes + std::size_t{3} * x,
                         *b = decoded.at(x, y);
      sum += kind == DataKind::kVectors ? chord(a, b) : squares(a, b);
    }
  return sum;
}

/// The windows as they are coded, which point into `made` where that is something else.
std::vector<PixelWindow> coded_windows(const CodingSpace& space, std::span<const PixelWindow> windows,
                                       std::vector<Pixels>& made) {
  std::vector<PixelWindow> out(windows.begin(), windows.end());
  if (!space.without_z) return out;
  for (const PixelWindow& window : windows) made.push_back(without_z(window));
  for (std::size_t w = 0; w < out.size(); ++w)
    out[w].data = made[w].data.data(), out[w].stride_bytes = std::size_t{3} * made[w].width_px;
  return out;
}

RateCurve measure(DataKind kind, const CodingSpace& space, std::span<const PixelWindow> windows,
                  const RunContext& context) {
  JpegKind jpeg;
  jpeg.rgb = space.apart;
  jpeg.coarse_last = space.coarse_last;
  jpeg.subsampling = space.subsampling;
  std::vector<Pixels> made;
  const std::vector<PixelWindow> coded = coded_windows(space, windows, made);
  const std::vector<double> bits = jpeg_bits(jpeg, coded, kQualities, context);
  RateCurve out;
  for (std::size_t q = 0; q < kQualities.size(); ++q) {
    jpeg.quality = kQualities[q];
    const double error = parallel_sum(context, windows.size(), 16, [&](std::size_t begin, std::size_t end) {
      JpegCoder coder(jpeg);
      double sum = 0;
      for (std::size_t w = begin; w < end; ++w) {
        const std::uint64_t area = std::uint64_t{windows[w].width_px} * windows[w].height_px;
        Pixels decoded = decode_jpeg(coder.complete_as_is(coded[w]), area);
        if (space.without_z) rebuild_z(decoded);
        sum += error_of(kind, windows[w], decoded);
      }
      return sum;
    });
    out.bits[q] = portable::log(std::max(bits[q], 1.0));
    out.error[q] = portable::log(std::max(error, kNoError));
  }
  return out;
}

/// The mean logarithm of the one's bits over the other's, at errors that both have. A large number where
/// there are none, or where the other's least error is out of reach.
double more_bits(const RateCurve& one, const RateCurve& other) {
  constexpr double kFarMore = 1e9;
  const double least = std::max(one.least_error(), other.least_error());
  const double most = std::min(one.most_error(), other.most_error());
  if (!(least < most) || one.least_error() > other.least_error() + portable::log(kMostTimesLeastError))
    return kFarMore;
  double sum = 0;
  for (int k = 0; k < kComparedErrors; ++k) {
    const double error = least + (most - least) * k / (kComparedErrors - 1);
    sum += one.bits_at(error) - other.bits_at(error);
  }
  return sum / kComparedErrors;
}

}  // namespace

JpegKind jpeg_kind(const PlaneCoding& plane, int quality) {
  JpegKind kind;
  kind.channels = plane.channels;
  kind.quality = quality;
  kind.subsampling = plane.apart ? Subsampling::k444 : plane.subsampling;
  kind.rgb = plane.channels == 3 && plane.apart;
  kind.coarse_last = kind.rgb && plane.coarse_last;
  return kind;
}

JpegKind baseline_kind(const PlaneCoding& plane, int quality) {
  JpegKind kind = jpeg_kind(plane, quality);
  if (quality < kFinestQuality || plane.channels != 3) return kind;
  kind.subsampling = Subsampling::k444;
  kind.rgb = true;
  kind.coarse_last = false;
  return kind;
}

namespace {

// A coded symbol of the sample weighs this much against one that the sample lacks but an image may have:
// every such symbol needs a code, because libjpeg-turbo writes a damaged stream for one that has none.
constexpr std::uint64_t kSampleWeight = 16;

HuffmanTable table_for(const std::array<std::uint64_t, 256>& count,
                       const std::vector<std::uint8_t>& symbols) {
  std::vector<std::uint64_t> weights;
  for (const std::uint8_t symbol : symbols) weights.push_back(kSampleWeight * count[symbol] + 1);
  return make_huffman_table(symbols, weights);
}

/// Of rising qualities, how many are below the finest.
std::size_t rungs_below_finest(std::span<const int> qualities) {
  return qualities.size() - (!qualities.empty() && qualities.back() == kFinestQuality ? 1 : 0);
}

/// How many have one kind but for the quality: all below the finest, or all.
std::size_t rungs_alike(const PlaneCoding& plane, std::span<const int> qualities) {
  const bool also_finest = plane.channels != 3 || (plane.apart && !plane.coarse_last);
  return also_finest ? qualities.size() : rungs_below_finest(qualities);
}

class JpegCodec : public TextureCodec {
 public:
  explicit JpegCodec(const PlaneCoding& plane) : plane_(plane) {}
  Codec id() const override { return plane_.without_z ? Codec::kJpegXy : Codec::kJpeg; }

  std::vector<CodecRung> train(std::span<const PixelWindow> sample, const RunContext& context) override {
    std::vector<CodecRung> rungs(plane_.qualities.size());
    huffman_tables_.resize(rungs.size());
    std::vector<PixelWindow> whole, part;
    for (const PixelWindow& window : sample) (wholly_covered(window) ? whole : part).push_back(window);
    std::vector<Training> training(rungs.size());
    for_each(context, rungs.size(), [&](std::size_t r) { training[r] = train_plainly(r, whole, part); });
    if (!part.empty()) count_masked(part, context, training);
    for_each(context, rungs.size(), [&](std::size_t r) {
      JpegCoder coder(kind_of(r));
      huffman_tables_[r] = sample.empty() ? coder.tables() : tables_for(coder, training[r].counts);
      coder.use_tables(huffman_tables_[r]);
      rungs[r] = {plane_.qualities[r],
                  coder.head_stream(plane_.fragment_width_px, plane_.fragment_height_px)};
    });
    return rungs;
  }

  std::unique_ptr<FragmentEncoder> encoder(std::span<const std::size_t> rungs) const override {
    return std::make_unique<Encoder>(*this, rungs);
  }

 private:
  /// Of one rung: what masked blocks are to be chosen by, and symbols.
  struct Training {
    MaskedRung masked;
    SymbolCounts counts;
  };

  JpegKind kind_of(std::size_t rung) const { return baseline_kind(plane_, plane_.qualities[rung]); }

  static void for_each(const RunContext& context, std::size_t count,
                       const std::function<void(std::size_t)>& body) {
    parallel_each(context, count, 1, [&](std::size_t k) { body(k); });
  }

  static HuffmanTables tables_for(const JpegCoder& coder, const SymbolCounts& counts) {
    const auto possible = coder.possible_symbols();
    HuffmanTables tables;
    for (std::size_t k = 0; k < counts.size(); ++k) tables.push_back(table_for(counts[k], possible[k]));
    return tables;
  }

  /// Counts the symbols of wholly covered windows. Which symbols masked blocks take depends on the bits of
  /// symbols: those of plain blocks for a start.
  Training train_plainly(std::size_t r, std::span<const PixelWindow> whole,
                         std::span<const PixelWindow> part) const {
    const JpegKind kind = kind_of(r);
    JpegCoder coder(kind);
    Training out;
    out.counts.resize(coder.tables().size());
    for (const PixelWindow& window : whole) coder.count_symbols(window, out.counts);
    if (part.empty()) return out;
    SymbolCounts all = out.counts;
    for (const PixelWindow& window : part) coder.count_symbols(window, all);
    out.masked = masked_rung(kind, coder.quantisers(), tables_for(coder, all));
    return out;
  }

  /// Adds those of windows covered in part.
  void count_masked(std::span<const PixelWindow> part, const RunContext& context,
                    std::vector<Training>& training) const {
    std::vector<MaskedRung> rungs;
    for (const Training& t : training) rungs.push_back(t.masked);
    std::vector<std::vector<SymbolCounts>> counts(part.size());
    for_each(context, part.size(), [&](std::size_t w) {
      counts[w].assign(rungs.size(), SymbolCounts(training[0].counts.size()));
      const std::size_t alike = rungs_alike(plane_, plane_.qualities);
      const std::span<const MaskedRung> all(rungs);
      const std::span<SymbolCounts> into(counts[w]);
      if (alike > 0) MaskedJpeg(kind_of(0)).count_symbols(part[w], all.first(alike), into.first(alike));
      if (alike < rungs.size())
        MaskedJpeg(kind_of(alike)).count_symbols(part[w], all.subspan(alike), into.subspan(alike));
    });
    for (const auto& window : counts)
      for (std::size_t r = 0; r < window.size(); ++r) add_counts(training[r].counts, window[r]);
  }

  class Encoder : public FragmentEncoder {
   public:
    Encoder(const JpegCodec& codec, std::span<const std::size_t> rungs) {
      std::vector<int> qualities;
      for (std::size_t k = 0; k < (rungs.empty() ? codec.huffman_tables_.size() : rungs.size()); ++k) {
        const std::size_t r = rungs.empty() ? k : rungs[k];
        const JpegKind kind = codec.kind_of(r);
        qualities.push_back(kind.quality);
        coders_.push_back(std::make_unique<JpegCoder>(kind));
        coders_.back()->use_tables(codec.huffman_tables_[r]);
        rungs_.push_back(masked_rung(kind, coders_.back()->quantisers(), codec.huffman_tables_[r]));
        if (k == 0) masked_.emplace(kind);
      }
      alike_ = rungs_alike(codec.plane_, qualities);
      below_finest_ = rungs_below_finest(qualities);
      if (below_finest_ < rungs_.size()) finest_.emplace(baseline_kind(codec.plane_, kFinestQuality));
    }
    // Rung after rung of one fragment, so that its pixels stay in the cache; rung by rung costs a quarter
    // more.
    void encode(const PixelWindow& fragment, std::span<std::vector<std::uint8_t>> streams) override {
      const std::span<const MaskedRung> rungs(rungs_);
      const bool whole = wholly_covered(fragment);
      const std::size_t first = whole ? below_finest_ : alike_;
      if (whole)
        for (std::size_t r = 0; r < first; ++r) coders_[r]->append_body(fragment, streams[r]);
      else if (first > 0)
        masked_->append_bodies(fragment, rungs.first(first), streams.first(first));
      // libjpeg's coefficients are the nearest ones: more samples would be off.
      if (first < rungs.size())
        finest_->append_bodies(fragment, rungs.subspan(first), streams.subspan(first));
    }

   private:
    std::vector<std::unique_ptr<JpegCoder>> coders_;
    std::vector<MaskedRung> rungs_;
    std::size_t alike_ = 0, below_finest_ = 0;
    std::optional<MaskedJpeg> masked_, finest_;  // of the first rung's kind; of a rung of the finest quality
  };

  PlaneCoding plane_;
  std::vector<HuffmanTables> huffman_tables_;
};

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
    parallel_each(context, rungs.size(), 1, [&](std::size_t r) {
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

std::unique_ptr<TextureCodec> make_progressive_codec(const PlaneCoding& plane) {
  const int rungs = static_cast<int>(scans_of_rungs(plane.channels).size());
  if (plane.qualities.back() < rungs)
    throw StageError("ladder", "highest quality",
                     "at least " + std::to_string(rungs) + " for progressive files",
                     std::to_string(plane.qualities.back()));
  return std::make_unique<ProgressiveCodec>(plane);
}

class WebpCodec : public TextureCodec {
 public:
  explicit WebpCodec(const PlaneCoding& plane) : plane_(plane) {}
  Codec id() const override { return Codec::kWebp; }
  std::vector<CodecRung> train(std::span<const PixelWindow>, const RunContext&) override {
    std::vector<CodecRung> rungs;
    for (const int quality : plane_.qualities) rungs.push_back({quality, {}});
    return rungs;
  }
  std::unique_ptr<FragmentEncoder> encoder(std::span<const std::size_t> rungs) const override {
    std::vector<int> qualities = rungs.empty() ? plane_.qualities : std::vector<int>();
    for (const std::size_t r : rungs) qualities.push_back(plane_.qualities[r]);
    return std::make_unique<Encoder>(std::move(qualities));
  }

 private:
  class Encoder : public FragmentEncoder {
   public:
    explicit Encoder(std::vector<int> qualities) : qualities_(std::move(qualities)) {}
    void encode(const PixelWindow& fragment, std::span<std::vector<std::uint8_t>> streams) override {
      WebpOptions options;
      options.as_large_as_jpeg = true;
      for (std::size_t r = 0; r < qualities_.size(); ++r) {
        options.quality = static_cast<float>(qualities_[r]);
        append_webp(fragment, 3, options, streams[r]);
      }
    }

   private:
    std::vector<int> qualities_;
  };
  PlaneCoding plane_;
};

std::unique_ptr<TextureCodec> make_webp_codec(const PlaneCoding& plane) {
  // Lossy WebP is always 4:2:0 YCbCr, which data do not bear, and knows no grey.
  if (plane.channels != 3 || plane.apart)
    throw StageError("ladder", "WebP", "a plane of colours", "data or a single channel");
  return std::make_unique<WebpCodec>(plane);
}

/// Of 255ths.
int component(std::uint8_t byte) { return 2 * byte - 255; }

}  // namespace

std::unique_ptr<TextureCodec> make_texture_codec(Codec codec, const PlaneCoding& plane) {
  if (plane.channels != 1 && plane.channels != 3)
    throw StageError("ladder", "channels", "1 or 3", std::to_string(plane.channels));
  if (plane.qualities.empty()) throw StageError("ladder", "rungs", "at least one", "none");
  switch (codec) {
    case Codec::kJpegProgressive:
      return make_progressive_codec(plane);
    case Codec::kWebp:
      return make_webp_codec(plane);
    case Codec::kJpeg:
    case Codec::kJpegXy:
      break;
  }
  return std::make_unique<JpegCodec>(plane);
}

Pixels decode_fragment_file(Codec codec, std::span<const std::uint8_t> file, std::uint64_t max_pixels) {
  if (codec == Codec::kWebp) return decode_lossy_webp(file, max_pixels);
  Pixels pixels = decode_jpeg(file, max_pixels);
  if (codec == Codec::kJpegXy) rebuild_z(pixels);
  return pixels;
}

Pixels decode_fragment_file_luma(Codec codec, std::span<const std::uint8_t> file, std::uint64_t max_pixels) {
  return codec == Codec::kJpeg || codec == Codec::kJpegProgressive
             ? decode_jpeg_luma(file, max_pixels)
             : luma_of(decode_fragment_file(codec, file, max_pixels));
}

std::vector<std::uint8_t> fragment_file(const PlaneLadder& plane, std::size_t rung, std::size_t fragment) {
  const bool incremental = codec_traits(plane.codec).incremental;
  std::vector<std::span<const std::uint8_t>> streams;
  for (std::size_t r = incremental ? 0 : rung; r <= rung; ++r)
    streams.push_back(fragment_stream(plane.rungs[r], fragment));
  return join_fragment(plane.codec, plane.rungs[incremental ? 0 : rung].table_stream, streams);
}

Pixels decode_fragment(const PlaneLadder& plane, std::size_t rung, std::size_t fragment,
                       std::uint64_t max_pixels) {
  return decode_fragment_file(plane.codec, fragment_file(plane, rung, fragment), max_pixels);
}

Pixels decode_fragment_luma(const PlaneLadder& plane, std::size_t rung, std::size_t fragment,
                            std::uint64_t max_pixels) {
  return decode_fragment_file_luma(plane.codec, fragment_file(plane, rung, fragment), max_pixels);
}

void rebuild_z(Pixels& pixels) {
  if (pixels.channels != 3) return;
  for (std::size_t i = 0; i < pixels.data.size(); i += 3) {
    const int x = component(pixels.data[i]), y = component(pixels.data[i + 1]);
    const int rest = std::max(255 * 255 - x * x - y * y, 0);
    pixels.data[i + 2] = static_cast<std::uint8_t>((256 + static_cast<int>(std::sqrt(rest))) / 2);
  }
}

Pixels without_z(const PixelWindow& window) {
  Pixels out{window.width_px, window.height_px, 3, {}};
  out.data.reserve(std::size_t{3} * window.width_px * window.height_px);
  for (std::uint32_t y = 0; y < window.height_px; ++y) {
    const std::uint8_t* texel = window.data + y * window.stride_bytes;
    for (std::uint32_t x = 0; x < window.width_px; ++x, texel += 3) {
      double squares = 0;
      for (int c = 0; c < 3; ++c) squares += component(texel[c]) * component(texel[c]);
      const double scale = 127.5 / std::sqrt(squares);  // 255 is odd, so that no vector is 0
      for (int c = 0; c < 2; ++c)
        out.data.push_back(static_cast<std::uint8_t>(std::min(component(texel[c]) * scale + 128, 255.0)));
      out.data.push_back(128);
    }
  }
  return out;
}

CodingSpace measure_coding_space(DataKind kind, bool needs_z, std::span<const PixelWindow> sample,
                                 const RunContext& context) {
  std::vector<PixelWindow> windows;
  const std::size_t count = std::min(sample.size(), kMostWindows);
  for (std::size_t k = 0; k < count; ++k) windows.push_back(sample[k * sample.size() / count]);
  if (windows.empty()) return kApart;
  RunContext quiet = context;
  quiet.progress = nullptr;
  const RateCurve apart = measure(kind, kApart, windows, quiet);
  CodingSpace best = kApart;
  double least = 0;
  for (const CodingSpace& space : kOthers) {
    if ((space.coarse_last || space.without_z) && kind != DataKind::kVectors) continue;
    if (space.without_z && needs_z) continue;
    const double more = more_bits(measure(kind, space, windows, quiet), apart);
    if (more < least) best = space, least = more;
  }
  return best;
}

}  // namespace texmesh
