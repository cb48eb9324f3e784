#include "stages/ladder/encode_rungs.h"

#include <map>
#include <mutex>

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"
#include "stages/fragment_codec/requantised_jpeg.h"
#include "stages/image/decode_image.h"
#include "stages/jpeg/masked_jpeg.h"

namespace texmesh {
namespace {

/// What samples show of a plane: this part of its pixels, but at least so many. Huffman tables need fewer
/// than sizes: with 131072 the textures of a helmet, 512 px, take .3 % fewer bytes, and the stage a fifth
/// more time.
constexpr std::uint64_t kSampleDivisor = 16, kLeastSamplePixels = 131072, kLeastTrainingPixels = 32768;

/// The part of the window at (left, top).
PixelWindow part_of(PixelWindow window, std::uint32_t channels, const TexelRectangle& part) {
  window.data += part.top_px * window.stride_bytes + std::size_t{part.left_px} * channels;
  window.coverage.left_px += part.left_px;
  window.coverage.top_px += part.top_px;
  window.width_px = part.width_px;
  window.height_px = part.height_px;
  return window;
}

/// What one thread encodes at a time: a fragment at every rung.
struct EncodeTask {
  std::size_t plane, fragment;
};

std::vector<EncodeTask> encode_tasks(const std::vector<PlaneWork>& work) {
  std::vector<EncodeTask> tasks;
  for (std::size_t p = 0; p < work.size(); ++p)
    for (std::size_t f = 0; f < work[p].wanted.size(); ++f) tasks.push_back({p, f});
  return tasks;
}

/// Encoders that no thread uses at the moment. Tasks come plane by plane, so encoders of earlier planes are
/// dropped.
class EncoderPool {
 public:
  EncoderPool(const std::vector<TrainedPlane>& trained, const std::vector<PlaneWork>& work)
      : trained_(trained), work_(work) {}
  std::unique_ptr<FragmentEncoder> borrow(std::size_t plane) {
    const std::lock_guard lock(mutex_);
    if (plane > plane_) {
      plane_ = plane;
      free_.clear();
    }
    if (plane < plane_ || free_.empty()) return trained_[plane].codec->encoder(work_[plane].rungs);
    auto encoder = std::move(free_.back());
    free_.pop_back();
    return encoder;
  }
  void give_back(std::size_t plane, std::unique_ptr<FragmentEncoder> encoder) {
    const std::lock_guard lock(mutex_);
    if (plane == plane_) free_.push_back(std::move(encoder));
  }

 private:
  const std::vector<TrainedPlane>& trained_;
  const std::vector<PlaneWork>& work_;
  std::mutex mutex_;
  std::size_t plane_ = 0;
  std::vector<std::unique_ptr<FragmentEncoder>> free_;
};

using Streams = std::vector<Bytes>;  // of one fragment, by rung

/// Puts streams into the rungs in the order of the tasks, whichever thread is done first. Tasks are also
/// begun in order, so there are never more than a few waiting.
class OrderedStreams {
 public:
  OrderedStreams(std::vector<PlaneLadder>& planes, const std::vector<EncodeTask>& tasks)
      : planes_(planes), tasks_(tasks) {}
  void add(std::size_t task, Streams streams) {
    const std::lock_guard lock(mutex_);
    waiting_.emplace(task, std::move(streams));
    for (auto it = waiting_.begin(); it != waiting_.end() && it->first == next_; it = waiting_.erase(it))
      append(it->second, planes_[tasks_[next_++].plane]);
  }

 private:
  static void append(const Streams& streams, PlaneLadder& plane) {
    for (std::size_t r = 0; r < streams.size(); ++r) {
      LadderRung& rung = plane.rungs[r];
      rung.data.insert(rung.data.end(), streams[r].begin(), streams[r].end());
      rung.offset.push_back(rung.data.size());
    }
  }
  std::vector<PlaneLadder>& planes_;
  const std::vector<EncodeTask>& tasks_;
  std::mutex mutex_;
  std::size_t next_ = 0;
  std::map<std::size_t, Streams> waiting_;
};

/// Those of the fragment; none where it is not stored.
Streams known_streams(const std::vector<LadderRung>& known, std::size_t fragment) {
  Streams out;
  if (known.empty() || fragment_stream(known[0], fragment).empty()) return out;
  for (const LadderRung& rung : known) {
    const auto stream = fragment_stream(rung, fragment);
    out.emplace_back(stream.begin(), stream.end());
  }
  return out;
}

/// The ladders before their first stream.
std::vector<PlaneLadder> empty_ladders(const std::vector<TrainedPlane>& trained,
                                       std::vector<PlaneWork>& work) {
  std::vector<PlaneLadder> planes(trained.size());
  for (std::size_t p = 0; p < planes.size(); ++p) {
    planes[p].codec = trained[p].codec->id();
    planes[p].source_rung = trained[p].source_rung;
    if (work[p].wanted.empty()) {
      planes[p].rungs = std::move(work[p].known);
      continue;
    }
    for (const std::size_t r : work[p].rungs)
      planes[p].rungs.push_back({trained[p].rungs[r].quality, trained[p].rungs[r].table_stream, {}, {0}});
  }
  return planes;
}

// Bytes of the rungs below, as parts of the top's: 2.5 times apart.
constexpr double kByteShares[] = {0.065, 0.16, 0.4};
// A quality is taken for a part that it misses by this factor at most, and not when it costs nearly the
// top's.
constexpr double kMostOff = 1.6, kMostShare = 0.75;
// A coded symbol of the sample weighs this much against one that the sample lacks but a fragment may have.
constexpr std::uint64_t kSampleWeight = 16;

/// All that the rungs of a plane share.
struct SourcePlane {
  SourcePlane(const TexturePlane& p, const Pixels& filled, const Image& image, const LadderOptions& o)
      : plane(p), pixels(filled), options(o), coefficients(image.name, image.bytes) {}
  PixelWindow window(std::size_t fragment) const {
    return fragment_window(plane, pixels, options.uncovered, fragment);
  }

  const TexturePlane& plane;
  const Pixels& pixels;
  const LadderOptions& options;
  JpegCoefficients coefficients;
  SourceLayout layout;
  std::vector<BlockKind> kinds;  // by component
};

/// IJG's quantisers of a quality, and what can be coded with them.
struct StandardRung {
  std::vector<SourceLayout::Quantisers> quantisers;  // by component
  std::vector<std::vector<std::uint8_t>> possible;   // symbols, by table
  HuffmanTables typical;
};

StandardRung standard_rung(const SourcePlane& source, int quality) {
  JpegKind kind;
  kind.channels = static_cast<std::uint32_t>(source.layout.components.size());
  kind.quality = quality;
  kind.rgb = kind.channels == 3 && (source.layout.rgb || !is_colour(source.plane.role));
  const JpegCoder coder(kind);
  return {coder.quantisers(), coder.possible_symbols(), coder.tables()};
}

/// `symbols` by table; of those without a count only these get a code.
HuffmanTables tables_of(const SymbolCounts& counts, const std::vector<std::vector<std::uint8_t>>& symbols) {
  HuffmanTables out;
  for (std::size_t t = 0; t < counts.size(); ++t) {
    std::vector<std::uint64_t> weights;
    for (const std::uint8_t s : symbols[t]) weights.push_back(kSampleWeight * counts[t][s] + 1);
    out.push_back(make_huffman_table(symbols[t], weights));
  }
  return out;
}

/// Those that were counted; one where none was.
std::vector<std::vector<std::uint8_t>> counted_symbols(const SymbolCounts& counts) {
  std::vector<std::vector<std::uint8_t>> out;
  for (const auto& count : counts) {
    auto& symbols = out.emplace_back();
    for (std::size_t s = 0; s < count.size(); ++s)
      if (count[s] > 0) symbols.push_back(static_cast<std::uint8_t>(s));
    if (symbols.empty()) symbols = {0};
  }
  return out;
}

MaskedRung coding_with(const SourcePlane& source, const std::vector<SourceLayout::Quantisers>& quantisers,
                       const HuffmanTables& tables) {
  MaskedRung out;
  for (std::size_t c = 0; c < quantisers.size(); ++c) {
    const std::size_t pair = source.layout.pairs[c];
    out.push_back(block_coding(source.kinds[c], quantisers[c], tables[2 * pair], tables[2 * pair + 1]));
  }
  return out;
}

/// Sums over windows of the symbols of all rungs; nothing when some number of the source has no symbol.
std::optional<std::vector<SymbolCounts>> count_all(const SourcePlane& source,
                                                   std::span<const SourceRung> rungs,
                                                   std::span<const PixelWindow> windows,
                                                   const RunContext& context) {
  const std::size_t tables = source.layout.components.size() == 1 ? 2 : 4;
  std::vector<std::vector<SymbolCounts>> counted(windows.size());
  std::vector<std::uint8_t> fits(windows.size(), 1);
  parallel_for(context, windows.size(), 1, [&](std::size_t begin, std::size_t end) {
    RequantisedJpeg coder(source.coefficients, source.layout);
    for (std::size_t w = begin; w < end; ++w) {
      counted[w].assign(rungs.size(), SymbolCounts(tables));
      fits[w] = coder.count_symbols(windows[w], rungs, counted[w]);
    }
  });
  if (std::ranges::count(fits, 0) > 0) return std::nullopt;
  std::vector<SymbolCounts> sum(rungs.size(), SymbolCounts(tables));
  for (const auto& window : counted)
    for (std::size_t r = 0; r < window.size(); ++r) add_counts(sum[r], window[r]);
  return sum;
}

class CoefficientCodec : public TextureCodec {
 public:
  explicit CoefficientCodec(std::unique_ptr<SourcePlane> source) : source_(std::move(source)) {}
  const SourcePlane& source() const { return *source_; }
  Codec id() const override { return Codec::kJpeg; }
  std::vector<CodecRung> train(std::span<const PixelWindow>, const RunContext&) override {
    return described_;
  }
  std::unique_ptr<FragmentEncoder> encoder(std::span<const std::size_t> rungs) const override {
    return std::make_unique<Encoder>(*this, rungs);
  }

  /// The rungs below the top.
  void add_standard_rungs(const std::vector<int>& qualities, const RunContext& context) {
    std::vector<StandardRung> standard;
    for (const int quality : qualities) {
      standard.push_back(standard_rung(*source_, quality));
      rungs_.push_back({coding_with(*source_, standard.back().quantisers, standard.back().typical), false});
    }
    const std::uint32_t rows = std::max(source_->layout.mcu_height_px, kSampleRows);
    const std::vector<PixelWindow> sample =
        training_sample(source_->plane, source_->pixels, source_->options.uncovered,
                        source_->options.training_fragments, rows);
    for (int pass = 0; pass < 2 && !rungs_.empty();
         ++pass) {  // which symbols are chosen depends on their bits
      const auto counts = count_all(*source_, rungs_, sample, context);
      described_.clear();
      for (std::size_t r = 0; r < qualities.size(); ++r) {
        const HuffmanTables tables = tables_of((*counts)[r], standard[r].possible);
        rungs_[r].coding = coding_with(*source_, standard[r].quantisers, tables);
        described_.push_back({qualities[r], head(standard[r].quantisers, tables)});
      }
    }
  }

  /// The source's coefficients; false when baseline JPEG has no symbols for them.
  bool add_top(int quality, const RunContext& context) {
    const auto& quantisers = source_->layout.quantisers;
    std::vector<PixelWindow> windows;
    for (std::size_t f = 0; f < source_->plane.fragment_count(); ++f)
      if (source_->plane.covered_texels[f] > 0) windows.push_back(source_->window(f));
    const HuffmanTables typical = standard_rung(*source_, 50).typical;
    SourceRung top{coding_with(*source_, quantisers, typical), true};
    const auto counts = count_all(*source_, std::span(&top, 1), windows, context);
    if (!counts) return false;
    const HuffmanTables tables = tables_of(counts->front(), counted_symbols(counts->front()));
    top.coding = coding_with(*source_, quantisers, tables);
    rungs_.push_back(std::move(top));
    described_.push_back({quality, head(quantisers, tables)});
    return true;
  }

 private:
  Bytes head(const std::vector<SourceLayout::Quantisers>& quantisers, const HuffmanTables& tables) const {
    return source_head(source_->layout, quantisers, tables, source_->plane.fragment_width_px,
                       source_->plane.fragment_height_px);
  }

  class Encoder : public FragmentEncoder {
   public:
    Encoder(const CoefficientCodec& codec, std::span<const std::size_t> rungs)
        : coder_(codec.source_->coefficients, codec.source_->layout) {
      if (rungs.empty()) rungs_ = codec.rungs_;
      for (const std::size_t r : rungs) rungs_.push_back(codec.rungs_[r]);
    }
    void encode(const PixelWindow& fragment, std::span<std::vector<std::uint8_t>> streams) override {
      coder_.append_bodies(fragment, rungs_, streams);
    }

   private:
    RequantisedJpeg coder_;
    std::vector<SourceRung> rungs_;
  };

  std::unique_ptr<SourcePlane> source_;
  std::vector<SourceRung> rungs_;
  std::vector<CodecRung> described_;
};

/// Bits of a sample at qualities below `top`, and there those of the source itself; [0..100].
std::vector<double> bits_by_quality(const SourcePlane& source, int top, const RunContext& context) {
  const std::uint32_t rows = std::max(source.layout.mcu_height_px, kSampleRows);
  const auto sample = size_sample(source.plane, source.pixels, source.options.uncovered, rows);
  if (sample.empty()) return {};
  // Colours have knots at every quality; choosing rungs takes fewer.
  const int step = is_colour(source.plane.role) ? 1 : 4;
  std::vector<QuantiserSet> sets;
  for (int q = 1; q < top; q += step) sets.push_back({standard_rung(source, q).quantisers});
  sets.push_back({source.layout.quantisers, true});
  const std::vector<double> bits =
      requantised_bits(source.coefficients, source.layout, source.kinds, sample, sets, context);
  std::vector<double> out(101);
  for (std::size_t k = 0; k + 1 < bits.size(); ++k) out[1 + k * static_cast<std::size_t>(step)] = bits[k];
  out[static_cast<std::size_t>(top)] = bits.back();
  return out;
}

/// The qualities below `top` whose bits are nearest to the wanted parts of the top's, rising.
std::vector<int> qualities_by_bytes(const std::vector<double>& bits, int top) {
  std::vector<int> out;
  if (bits.empty() || !(bits[static_cast<std::size_t>(top)] > 0)) return out;
  for (const double wanted : kByteShares) {
    int best = 0;
    double least = portable::log(kMostOff);
    for (int q = out.empty() ? 1 : out.back() + 1; q < top; ++q) {
      const double share = bits[static_cast<std::size_t>(q)] / bits[static_cast<std::size_t>(top)];
      if (!(share > 0) || share > kMostShare) continue;
      const double off = std::fabs(portable::log(share / wanted));
      if (off < least) best = q, least = off;
    }
    if (best > 0) out.push_back(best);
  }
  return out;
}

/// "" where the plane's fragments can keep the coefficients, whose layout is then set.
std::string prepare(SourcePlane& source) {
  const TexturePlane& plane = source.plane;
  const JpegCoefficients& from = source.coefficients;
  std::string why_not;
  auto layout = source_layout(from, plane.fragment_width_px, plane.fragment_height_px, why_not);
  if (!layout) return why_not;
  if (from.width_px() != plane.width_px || from.height_px() != plane.height_px ||
      layout->components.size() != plane.channels)
    return "it has another size or another number of channels";
  source.layout = std::move(*layout);
  for (std::size_t c = 0; c < plane.channels; ++c) {
    const bool luma = c == 0 && !source.layout.rgb && is_colour(plane.role);
    source.kinds.push_back(luma ? BlockKind::kLuma : BlockKind::kOther);
  }
  return "";
}

/// What the user has asked for, as far as there is room below the top.
std::vector<int> asked_qualities(TextureRole role, const LadderOptions& options) {
  std::vector<int> out = ladder_rungs(role, options);
  if (out.back() == 100) out.pop_back();
  return out;
}

}  // namespace

std::vector<std::size_t> covered_fragments(const TexturePlane& plane) {
  std::vector<std::size_t> out;
  for (std::size_t f = 0; f < plane.covered_texels.size(); ++f)
    if (plane.covered_texels[f] > 0) out.push_back(f);
  return out;
}

PixelWindow fragment_window(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered,
                            std::size_t fragment) {
  const TexelRectangle at = padded_fragment_rectangle(plane, fragment);
  CoverageWindow coverage{{}, at.left_px, at.top_px};
  const bool some = plane.covered_texels[fragment] < at.width_px * at.height_px;
  if (some && uncovered == Uncovered::kFree && !plane.coverage.empty()) coverage.mask = CoverageMask(plane);
  return {pixels.at(at.left_px, at.top_px), std::size_t{pixels.width_px} * pixels.channels, at.width_px,
          at.height_px, coverage};
}

std::vector<PixelWindow> training_sample(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered,
                                         int wanted, std::uint32_t rows) {
  const std::vector<std::size_t> covered = covered_fragments(plane);
  const std::uint64_t budget =
      std::max(std::uint64_t{pixels.width_px} * pixels.height_px / kSampleDivisor, kLeastTrainingPixels);
  const std::size_t count = std::min(covered.size(), static_cast<std::size_t>(std::max(wanted, 1)));
  // More windows and smaller ones show more of the plane for the same work. They are whole rows, because the
  // DC step from a row's end to the next row's begin is large: narrower windows would show it too often, and
  // the DC tables would be made for it.
  std::uint32_t height = rows;
  while (height < plane.fragment_height_px &&
         std::uint64_t{height + rows} * plane.fragment_width_px * count <= budget)
    height += rows;
  const std::uint32_t above = (plane.fragment_height_px - height) / (2 * rows) * rows;
  std::vector<PixelWindow> sample;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t fragment = covered[(2 * k + 1) * covered.size() / (2 * count)];
    sample.push_back(part_of(fragment_window(plane, pixels, uncovered, fragment), plane.channels,
                             {0, above, plane.fragment_width_px, height}));
  }
  return sample;
}

std::vector<PixelWindow> size_sample(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered,
                                     std::uint32_t rows) {
  // Whole rows show too few places: of 1024 px they leave 1.3 % of error where tiles leave 0.6 %.
  constexpr std::uint64_t kMostSamplePixels = 1 << 20;
  const std::vector<std::size_t> covered = covered_fragments(plane);
  const std::uint32_t width = std::min(plane.fragment_width_px, 64u);
  const std::uint32_t across = (plane.fragment_width_px + width - 1) / width;
  const std::size_t in_fragment = std::size_t{across} * (plane.fragment_height_px / rows);
  const std::size_t tiles = covered.size() * in_fragment;
  const std::uint64_t all_pixels = std::uint64_t{tiles} * width * rows;
  const std::uint64_t wanted = std::clamp(all_pixels / kSampleDivisor, kLeastSamplePixels, kMostSamplePixels);
  const std::size_t step = std::max<std::size_t>(all_pixels / wanted, 1);
  std::vector<PixelWindow> sample;
  for (std::uint32_t k = 0; (k + 1) * step <= tiles; ++k) {
    const std::uint64_t part = k * 0x9e3779b1u;  // the golden section of 2^32: spread evenly
    const std::size_t tile = k * step + (part * step >> 32);
    const std::size_t fragment = covered[tile / in_fragment], place = tile % in_fragment;
    const auto left = static_cast<std::uint32_t>(place % across) * width;
    sample.push_back(part_of(fragment_window(plane, pixels, uncovered, fragment), plane.channels,
                             {std::min(left, plane.fragment_width_px - width),
                              static_cast<std::uint32_t>(place / across) * rows, width, rows}));
  }
  return sample;
}

std::vector<PlaneLadder> encode_rungs(const Fragments& fragments, const std::vector<Pixels>& pixels,
                                      Uncovered uncovered, const std::vector<TrainedPlane>& trained,
                                      std::vector<PlaneWork> work, ProgressPart progress,
                                      const RunContext& context) {
  const std::vector<EncodeTask> tasks = encode_tasks(work);
  std::vector<PlaneLadder> planes = empty_ladders(trained, work);
  EncoderPool encoders(trained, work);
  OrderedStreams ordered(planes, tasks);
  std::atomic<std::size_t> next{0}, done{0};
  parallel_for(context, tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t t = next++;  // in order, whatever part of the range a thread was given
      const auto [p, f] = tasks[t];
      Streams streams = known_streams(work[p].known, f);
      if (streams.empty()) {
        streams.resize(work[p].rungs.size());
        if (work[p].wanted[f] && fragments.planes[p].covered_texels[f] > 0) {
          auto encoder = encoders.borrow(p);
          encoder->encode(fragment_window(fragments.planes[p], trained[p].coded(pixels[p]), uncovered, f),
                          streams);
          encoders.give_back(p, std::move(encoder));
        }
      }
      ordered.add(t, std::move(streams));
      const double part = static_cast<double>(++done) / static_cast<double>(tasks.size());
      context.report(progress.begin + (progress.end - progress.begin) * part);
    }
  });
  return planes;
}

SourceCodec make_source_codec(const TexturePlane& plane, const Pixels& pixels, const Image& image,
                              const LadderOptions& options, bool alone, const RunContext& context) {
  if (plane.mip > 0 || plane.role == TextureRole::kAlpha || image.format != ImageFormat::kJpeg) return {};
  SourceCodec out;
  RunContext quiet = context;
  quiet.progress = nullptr;
  if (changes_colours(image, is_colour(plane.role) ? FloatEncoding::kSrgb : FloatEncoding::kAsIs)) {
    out.why_not = "its colours are converted";
    return out;
  }
  std::unique_ptr<SourcePlane> source;
  try {
    source = std::make_unique<SourcePlane>(plane, pixels, image, options);
  } catch (const InputError& error) {
    out.why_not = "its coefficients cannot be read: " + std::string(error.what());
    return out;
  }
  out.why_not = prepare(*source);
  if (!out.why_not.empty()) return out;
  std::vector<int> below;
  if (!options.prune) below = asked_qualities(plane.role, options);
  const int top = std::max(quality_of(source->layout.quantisers[0]), below.empty() ? 1 : below.back() + 1);
  if (!alone || !options.prune) out.bits = bits_by_quality(*source, top, quiet);
  if (options.prune) below = qualities_by_bytes(out.bits, top);
  auto codec = std::make_unique<CoefficientCodec>(std::move(source));
  codec->add_standard_rungs(below, quiet);
  if (codec->add_top(top, quiet))
    out.codec = std::move(codec);
  else
    out.why_not = "it has coefficients that are too large for 8-bit samples";
  return out;
}

}  // namespace texmesh
