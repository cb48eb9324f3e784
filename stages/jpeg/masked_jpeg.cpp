#include "stages/jpeg/masked_jpeg.h"

namespace texmesh {
namespace {

constexpr SampleFactors kHalved{2, 2};

}  // namespace

MaskedRung masked_rung(const JpegKind& kind, const std::vector<std::array<std::uint16_t, 64>>& quantisers,
                       const HuffmanTables& tables) {
  MaskedRung out;
  for (std::size_t c = 0; c < kind.channels; ++c) {
    const std::size_t pair = table_pair(kind, c);
    out.push_back(block_coding(c == 0 && !kind.rgb ? BlockKind::kLuma : BlockKind::kOther, quantisers[c],
                               tables[2 * pair], tables[2 * pair + 1]));
  }
  return out;
}

bool wholly_covered(const PixelWindow& image) {
  if (image.coverage.mask.empty()) return true;
  for (std::uint32_t y = 0; y < image.height_px; ++y)
    for (std::uint32_t x = 0; x < image.width_px; ++x)
      if (!image.coverage.covered(x, y)) return false;
  return true;
}

MaskedJpeg::MaskedJpeg(const JpegKind& kind)
    : kind_(kind), halved_(halves_chroma(kind)), components_(kind.channels) {
  for (std::size_t c = 0; c < kind.channels; ++c) pairs_.push_back(table_pair(kind, c));
}

/// A sample of halved chroma is the mean of its covered texels.
void MaskedJpeg::halve(SamplePlane& chroma) const {
  const std::uint32_t w = chroma.width;
  chroma.width /= 2, chroma.height /= 2;
  std::vector<float> values(std::size_t{chroma.width} * chroma.height);
  for (std::uint32_t y = 0; y < chroma.height; ++y) {
    for (std::uint32_t x = 0; x < chroma.width; ++x) {
      float covered = 0, all = 0, count = 0;
      for (std::uint32_t k = 0; k < 4; ++k) {
        const std::uint32_t u = 2 * x + k % 2, v = 2 * y + k / 2;
        const float weight = covered_.at(u, v), value = chroma.values[std::size_t{v} * w + u];
        covered += weight * value, count += weight, all += value;
      }
      values[std::size_t{y} * chroma.width + x] = count > 0 ? covered / count : all / 4;
    }
  }
  chroma.values = std::move(values);
}

void MaskedJpeg::load(const PixelWindow& image) {
  covered_.load(image);
  blocks_[0].load(covered_, {});
  if (halved_) blocks_[1].load(covered_, kHalved);
  for (std::size_t c = 0; c < components_.size(); ++c) {
    SamplePlane& component = components_[c];
    component.width = image.width_px, component.height = image.height_px;
    jpeg_samples(image, kind_, c, component.values);
    if (halved_ && c > 0) halve(component);
  }
}

template <class Sink>
void MaskedJpeg::code_block(std::size_t component, std::uint32_t left, std::uint32_t top,
                            std::span<const MaskedRung> rungs, std::span<Sink> sinks) {
  const bool half = halved_ && component > 0;
  const BlockValues samples = components_[component].block(left, top);
  const BlockCoverage what = blocks_[half].at(left, top);
  float level = 0, same_level = 0;
  if (what == BlockCoverage::kNothing) {
    level = mean_of(samples);
    same_level = blocks_[half].same_level_at(left, top);
  }
  BlockValues coefficients{};
  if (what == BlockCoverage::kAll) coefficients = block_dct(samples);
  if (what == BlockCoverage::kPart) {
    BlockValues weights = covered_.weights(half ? kHalved : SampleFactors{}, left, top);
    for (float& w : weights) w = std::max(w, kUncoveredWeight);
    block_.load(samples, weights);
  }
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    const BlockCoding& coding = rungs[r][component];
    int& dc = dc_before_[r][component];
    const CodedBlock block = what == BlockCoverage::kAll    ? quantise_whole(coefficients, coding)
                             : what == BlockCoverage::kPart ? block_.quantise(coding, dc)
                                                            : flat_block(level, same_level, coding, dc);
    emit_block(block, dc, component, sinks[r]);
    dc = block.values[0];
  }
}

template <class Sink>
void MaskedJpeg::code(const PixelWindow& image, std::span<const MaskedRung> rungs, std::span<Sink> sinks) {
  load(image);
  dc_before_.assign(rungs.size(), {});
  const std::uint32_t side = halved_ ? 16 : 8;
  for (std::uint32_t y = 0; y < image.height_px; y += side)
    for (std::uint32_t x = 0; x < image.width_px; x += side)
      for (std::size_t c = 0; c < components_.size(); ++c) {
        const bool four = halved_ && c == 0, half = halved_ && c > 0;
        for (std::uint32_t b = 0; b < (four ? 4u : 1u); ++b)
          code_block(c, (half ? x / 2 : x) + b % 2 * 8, (half ? y / 2 : y) + b / 2 * 8, rungs, sinks);
      }
}

void MaskedJpeg::append_bodies(const PixelWindow& image, std::span<const MaskedRung> rungs,
                               std::span<std::vector<std::uint8_t>> streams) {
  std::vector<BitSink> sinks;
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    streams[r].insert(streams[r].end(), {0xff, 0xd8});
    sinks.emplace_back(streams[r], rungs[r]);
  }
  code(image, rungs, std::span(sinks));
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    sinks[r].finish();
    streams[r].insert(streams[r].end(), {0xff, 0xd9});
  }
}

void MaskedJpeg::count_symbols(const PixelWindow& image, std::span<const MaskedRung> rungs,
                               std::span<SymbolCounts> counts) {
  std::vector<CountSink> sinks;
  for (SymbolCounts& c : counts) sinks.emplace_back(pairs_, c);
  code(image, rungs, std::span(sinks));
}

}  // namespace texmesh
