#pragma once
// Inside the ladder only: which parts of a plane's pixels codecs are given, and all fragments through their
// planes' codecs, on several threads.
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/ladder/ladder.h"

namespace texmesh {

/// The codec of a plane whose source image is a JPEG.
struct SourceCodec {
  std::unique_ptr<TextureCodec> codec;  // of codec id jpeg; none: the plane is coded from its pixels
  std::string why_not;                  // of a JPEG without codec
  /// What a sample of the plane takes at each whole quality, [0..100], and at the top rung's what that takes;
  /// 0 above it, and of data at most qualities. Empty for an empty sample,
  /// and of a rung that is alone, which no other is compared with.
  std::vector<double> bits;
};

/// Codes the fragments of a full-size plane from the coefficients of its source, a JPEG that libjpeg reads as
/// 8-bit coefficients, in the source's components.
/// - The last rung has the source's coefficients wherever a covered texel is seen (RequantisedJpeg), and
/// Huffman
///   tables of exactly its symbols. Its quality is quality_of() the source's quantisers, or one more than
///   that of the highest rung that was asked for.
/// - The rungs below are requantised by IJG's tables: colours by both, data by the luma table alone, because
///   their chroma is as good as any channel (a turtle's normals: 525 kB and 2.7 degrees instead of 621 kB and
///   3.0). Multiples of the source's own quantisers were tried: on four scans the same bytes at equal error
///   at high qualities, up to a tenth more at low ones.
/// - `options.prune`: the qualities below are those whose bytes are nearest to fixed parts of the top's.
///   Otherwise they are all that `options` asks for, but 100. `alone`: with `options.prune` there is none.
/// The codec's train() has no use for its sample. `pixels` are the plane's, filled; `plane`, `pixels` and
/// `options` outlive the codec. It holds two bytes for every sample of the source. No codec for mips, alpha
/// planes and other formats. Same bytes for any thread count.
SourceCodec make_source_codec(const TexturePlane& plane, const Pixels& pixels, const Image& image,
                              const LadderOptions& options, bool alone, const RunContext& context);

std::vector<std::size_t> covered_fragments(const TexturePlane& plane);

/// Heights of windows in samples are multiples of this.
inline constexpr std::uint32_t kSampleRows = 16;

/// One fragment; with its coverage where some of its texels are not covered and these are free. Its place in
/// the plane is CoverageWindow::left_px and top_px in any case.
PixelWindow fragment_window(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered,
                            std::size_t fragment);

/// What Huffman tables are trained on: the middle rows of `wanted` covered fragments, evenly spread in index
/// order, or of all where there are fewer. Together they have 1/16 of the plane's pixels, or 131,072 where
/// that is more, so far as the fragments have so many. `rows`: their heights are multiples of this, which
/// divides the fragments'.
std::vector<PixelWindow> training_sample(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered,
                                         int wanted, std::uint32_t rows = kSampleRows);

/// What measure_size_knots() is shown: tiles of 64 x `rows` px all over the covered fragments, one of every
/// few at places that follow no pattern, up to 2^20 px.
std::vector<PixelWindow> size_sample(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered,
                                     std::uint32_t rows = kSampleRows);

/// A plane's codec after its training, and what the training gave.
struct TrainedPlane {
  PlaneCoding coding;
  std::unique_ptr<TextureCodec> codec;
  std::vector<CodecRung> rungs;
  SourceCodec source;        // without its codec, which is the one above
  bool source_rung = false;  // the last rung has the source's coefficients
  Pixels made;               // of codec jpeg-xy: what is coded, see without_z(); otherwise without texels
  /// What is coded of the plane's pixels.
  const Pixels& coded(const Pixels& pixels) const { return made.data.empty() ? pixels : made; }
};

/// What is encoded of one plane.
struct PlaneWork {
  std::vector<std::size_t> rungs;    // indices into TrainedPlane::rungs, rising
  std::vector<std::uint8_t> wanted;  // by fragment, 1 or 0; empty: nothing, `known` is the result
  std::vector<LadderRung> known;     // by index of `rungs`: streams that need no encoding; empty: none
};

/// Of the whole stage's progress.
struct ProgressPart {
  double begin, end;
};

/// The ladders of all planes: at the rungs of `work` the streams of the covered fragments that `work` wants.
/// Beside the result it takes some fragments' streams per thread. Same bytes for any thread count.
std::vector<PlaneLadder> encode_rungs(const Fragments& fragments, const std::vector<Pixels>& pixels,
                                      Uncovered uncovered, const std::vector<TrainedPlane>& trained,
                                      std::vector<PlaneWork> work, ProgressPart progress,
                                      const RunContext& context);

}  // namespace texmesh
