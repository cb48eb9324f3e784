// Baseline JPEG: every rung has Huffman tables trained on a sample of the plane, and everything that
// fragments have in common stands in the rung's table stream. Fragments with uncovered texels are coded by
// MaskedJpeg, and all of them at the finest quality; the others by libjpeg.
#include <functional>
#include <optional>

#include "stages/base/parallel.h"
#include "stages/fragment_codec/codec_list.h"
#include "stages/jpeg/jpeg_coder.h"
#include "stages/jpeg/masked_jpeg.h"

namespace texmesh {
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
    parallel_for(context, count, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) body(k);
    });
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
      for (std::size_t r = 0; r < window.size(); ++r)
        for (std::size_t k = 0; k < window[r].size(); ++k)
          for (std::size_t s = 0; s < window[r][k].size(); ++s) training[r].counts[k][s] += window[r][k][s];
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

}  // namespace

std::unique_ptr<TextureCodec> make_jpeg_codec(const PlaneCoding& plane) {
  return std::make_unique<JpegCodec>(plane);
}

}  // namespace texmesh
