#pragma once
// Inside the ladder only: which parts of a plane's pixels codecs are given, and all fragments through their
// planes' codecs, on several threads.
#include "stages/ladder/source_codec.h"

namespace texmesh {

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
