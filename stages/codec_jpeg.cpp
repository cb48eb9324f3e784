// Baseline JPEG: every rung has Huffman tables trained on a sample of the plane, and everything that
// fragments have in common stands in the rung's table stream. Fragments with uncovered texels are coded by
// MaskedJpeg, all others by libjpeg.
#include <algorithm>

#include "stages/jpeg_coder.h"
#include "stages/masked_jpeg.h"
#include "stages/parallel.h"
#include "stages/texture_codecs.h"

namespace texmesh {
namespace {

// A coded symbol of the sample weighs this much against one that the sample lacks but an image may have:
// every such symbol needs a code, because libjpeg-turbo writes a damaged stream for one that has none.
constexpr std::uint64_t kSampleWeight = 16;

JpegKind kind_of(const PlaneCoding& plane, int quality) {
  JpegKind kind;
  kind.channels = plane.channels;
  kind.quality = quality;
  kind.subsampling = plane.colour ? plane.subsampling : Subsampling::k444;
  kind.rgb = plane.channels == 3 && !plane.colour;
  return kind;
}

HuffmanTable table_for(const std::array<std::uint64_t, 256>& count,
                       const std::vector<std::uint8_t>& symbols) {
  std::vector<std::uint64_t> weights;
  for (const std::uint8_t symbol : symbols) weights.push_back(kSampleWeight * count[symbol] + 1);
  return make_huffman_table(symbols, weights);
}

class JpegCodec : public TextureCodec {
 public:
  explicit JpegCodec(const PlaneCoding& plane) : plane_(plane) {}
  Codec id() const override { return Codec::kJpeg; }

  std::vector<CodecRung> train(std::span<const PixelWindow> sample, const RunContext& context) override {
    std::vector<CodecRung> rungs(plane_.qualities.size());
    tables_.resize(rungs.size());
    parallel_for(context, rungs.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) {
        const JpegKind kind = kind_of(plane_, plane_.qualities[r]);
        JpegCoder coder(kind);
        tables_[r] = train_rung(kind, coder, sample);
        coder.use_tables(tables_[r]);
        rungs[r] = {plane_.qualities[r],
                    coder.head_stream(plane_.fragment_width_px, plane_.fragment_height_px)};
      }
    });
    return rungs;
  }

  std::unique_ptr<FragmentEncoder> encoder() const override { return std::make_unique<Encoder>(*this); }

 private:
  static HuffmanTables train_rung(const JpegKind& kind, JpegCoder& coder,
                                  std::span<const PixelWindow> sample) {
    HuffmanTables tables = coder.tables();
    SymbolCounts counts(tables.size());
    for (const PixelWindow& window : sample) coder.count_symbols(window, counts);
    const auto possible = coder.possible_symbols();
    for (std::size_t k = 0; k < tables.size() && !sample.empty(); ++k)
      tables[k] = table_for(counts[k], possible[k]);
    if (std::all_of(sample.begin(), sample.end(), wholly_covered)) return tables;
    // Which symbols masked blocks take depends on their bits: once more, with those of the plain blocks.
    const MaskedRung rung = masked_rung(kind, coder.quantisers(), tables);
    MaskedJpeg masked(kind);
    counts.assign(tables.size(), {});
    for (const PixelWindow& window : sample)
      if (wholly_covered(window))
        coder.count_symbols(window, counts);
      else
        masked.count_symbols(window, rung, counts);
    for (std::size_t k = 0; k < tables.size(); ++k) tables[k] = table_for(counts[k], possible[k]);
    return tables;
  }

  class Encoder : public FragmentEncoder {
   public:
    explicit Encoder(const JpegCodec& codec) : masked_(kind_of(codec.plane_, codec.plane_.qualities[0])) {
      for (std::size_t r = 0; r < codec.tables_.size(); ++r) {
        const JpegKind kind = kind_of(codec.plane_, codec.plane_.qualities[r]);
        coders_.push_back(std::make_unique<JpegCoder>(kind));
        coders_.back()->use_tables(codec.tables_[r]);
        rungs_.push_back(masked_rung(kind, coders_.back()->quantisers(), codec.tables_[r]));
      }
    }
    // Rung after rung of one fragment, so that its pixels stay in the cache; rung by rung costs a quarter
    // more.
    void encode(const PixelWindow& fragment, std::span<std::vector<std::uint8_t>> streams) override {
      if (!wholly_covered(fragment)) return masked_.append_bodies(fragment, rungs_, streams);
      for (std::size_t r = 0; r < coders_.size(); ++r) coders_[r]->append_body(fragment, streams[r]);
    }

   private:
    std::vector<std::unique_ptr<JpegCoder>> coders_;
    std::vector<MaskedRung> rungs_;
    MaskedJpeg masked_;
  };

  PlaneCoding plane_;
  std::vector<HuffmanTables> tables_;
};

}  // namespace

std::unique_ptr<TextureCodec> make_jpeg_codec(const PlaneCoding& plane) {
  return std::make_unique<JpegCodec>(plane);
}

}  // namespace texmesh
